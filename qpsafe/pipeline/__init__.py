"""The stages of a tick."""
