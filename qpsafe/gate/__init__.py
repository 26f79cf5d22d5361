"""Motion that is verified before it is sent (derivations, section 5)."""
