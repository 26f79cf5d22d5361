"""Thousands of paired encounters with people: what a controller buys, with confidence limits."""
