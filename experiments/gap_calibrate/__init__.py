"""Calibration of the confidences of a diagnosis."""
