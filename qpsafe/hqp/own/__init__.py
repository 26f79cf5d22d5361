"""The project's own hierarchical solver."""
