"""Other solvers behind the same call."""
