"""What a `robot.toml` may say, in SI units, and a first one for a model file."""
