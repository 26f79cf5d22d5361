"""Whether a program can be run as it is planned, before anything moves: reach, limits, singular poses, furniture."""
