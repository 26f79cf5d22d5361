"""The page of `qpsafe web`: a robot, people to drag with the mouse, and what the controller makes of it."""
