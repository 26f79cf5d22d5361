"""Command line of qpsafe: one file a command."""
