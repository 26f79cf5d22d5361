"""Spots on the skin of a robot: where they are, and what their sensors measure."""
