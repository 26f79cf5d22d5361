"""The page of `qpsafe web`: a robot, people that one drags, and what the controller thinks of it, in a browser."""
