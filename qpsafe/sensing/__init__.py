"""Distance sensors on the robot and the points they detect."""
