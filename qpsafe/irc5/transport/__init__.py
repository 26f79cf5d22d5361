"""Around the datagrams: which joints they tell, when they came, the newest of them, names of events."""
