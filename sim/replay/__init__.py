"""Runs of the controller on recorded data."""
