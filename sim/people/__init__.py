"""People: bodies, postures, walks."""
