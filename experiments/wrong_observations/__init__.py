"""Wrong marker observations are noticed and undone."""
