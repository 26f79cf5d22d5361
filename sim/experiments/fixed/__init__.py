"""The first experiment: a fixed tool."""
