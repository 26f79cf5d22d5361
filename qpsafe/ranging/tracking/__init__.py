"""Things followed from image to image: clusters of points, their velocities, and what these may do."""
