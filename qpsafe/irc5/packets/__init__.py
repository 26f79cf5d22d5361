"""What goes over the wire: packets of EGM, distances of sensors, names of events."""
