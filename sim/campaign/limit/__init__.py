"""What could have been done: the best motion with foresight, found by search, beside what a controller did."""
