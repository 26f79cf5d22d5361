"""Everything that ranges: images of many zones, on the robot or in the world, and what of them counts as danger."""
