"""Calibration of a robot: what is measured before an agent drives it, and the file of it."""
