"""Where a camera that is fixed in space is: found by the robot's own motion in its view."""
