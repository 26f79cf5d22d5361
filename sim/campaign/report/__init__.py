"""What rows say: statistics, figures, one page and JSON."""
