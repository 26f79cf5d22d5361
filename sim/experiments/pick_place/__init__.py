"""The third experiment: pick and place."""
