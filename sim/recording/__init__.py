"""What a run was: logs and run files."""
