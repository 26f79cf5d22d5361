"""The commands of `qpsafe demo`."""
