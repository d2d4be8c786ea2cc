"""The calibration of the confidence of a diagnosis."""
