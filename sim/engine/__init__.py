"""Encounters, compiled: what the world is made of in flat arrays, what sensors read in it, true distances."""
