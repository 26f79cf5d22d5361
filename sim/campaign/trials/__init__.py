"""One trial: who meets whom, the run of every controller, and what is measured of it."""
