"""Faults of the robot: monitors of muscles, motion and camera, and the guard that uses them."""
