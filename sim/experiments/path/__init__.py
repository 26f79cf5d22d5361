"""The second experiment: a line."""
