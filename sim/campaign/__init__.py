"""The proof: thousands of paired encounters of a robot with people."""
