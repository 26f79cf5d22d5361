"""Hierarchical quadratic programs: prioritised least squares under hard limits."""
