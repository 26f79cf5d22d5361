"""Commands about sensors: where they go, what they measure, and how they fail."""
