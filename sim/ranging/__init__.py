"""Sensors of many zones in simulation: what their zones meet, and what of it a real one would send."""
