"""Robots as the controller sees them: kinematics, limits, wire model, and how they are loaded."""
