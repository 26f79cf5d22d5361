"""Encounters of a robot with people, computed fast."""
