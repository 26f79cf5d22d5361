"""Suspension and return to the path."""
