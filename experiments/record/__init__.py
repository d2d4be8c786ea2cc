"""A log of a moving robot as a study for `reality_gap`."""
