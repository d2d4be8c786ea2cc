"""List of the runs on reporting seeds."""
