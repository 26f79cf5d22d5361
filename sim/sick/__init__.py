"""Sick sensors in closed loop."""
