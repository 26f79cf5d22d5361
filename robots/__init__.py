"""Bundled robots, one folder each: MJCF model, limits, wire model and spots."""
