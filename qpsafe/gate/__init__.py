"""Motion that is verified before it is sent (math section 5)."""
