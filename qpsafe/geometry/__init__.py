"""Convex shapes on moving bodies in flat arrays, and their distances, compiled."""
