"""Heat: core temperatures of the motors, their limit, and faults of the cooling."""
