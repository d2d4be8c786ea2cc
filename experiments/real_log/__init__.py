"""Map and joint estimator on the log of a measured cable-driven robot, offline."""
