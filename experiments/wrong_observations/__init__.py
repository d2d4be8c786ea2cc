"""Detection of updates from wrong marker observations."""
