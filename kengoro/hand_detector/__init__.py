"""A detector that finds a robot's hand in camera frames without a marker: its data and training."""
