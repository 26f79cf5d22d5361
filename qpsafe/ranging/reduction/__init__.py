"""From images and clouds of many points to the few that matter."""
