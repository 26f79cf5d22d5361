"""Where to put the distance sensors: section III of the paper."""
