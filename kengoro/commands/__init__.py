"""What the console script `kengoro` runs."""
