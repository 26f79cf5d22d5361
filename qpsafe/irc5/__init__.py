"""To and from an ABB IRC5: EGM messages, the streamer that answers the robot, reference logs, motor-side conversion."""
