"""Many robots stepped in one call, each robot's whole tick compiled."""
