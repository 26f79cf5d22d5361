"""Hierarchical quadratic programmes: prioritised least squares under hard limits."""
