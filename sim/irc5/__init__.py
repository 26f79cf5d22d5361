"""A simulated IRC5 at the other end of the wire."""
