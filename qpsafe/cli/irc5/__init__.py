"""Commands that speak with an IRC5, real or simulated."""
