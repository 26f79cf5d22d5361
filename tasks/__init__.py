"""What the robot is asked to do: tasks and the trajectories they follow."""
