"""Model files of robots, MJCF and URDF: read, checked, and made into kinematics and hulls."""
