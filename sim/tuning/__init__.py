"""Parameters of a controller, chosen by a search among encounters with people, and judged by other encounters."""
