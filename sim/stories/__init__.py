"""Stories: who walks, reaches and carries when."""
