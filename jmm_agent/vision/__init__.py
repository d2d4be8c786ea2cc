"""Marker poses in camera frames, and the joint angles that they show."""
