"""Monte Carlo of robots and people, to place sensors."""
