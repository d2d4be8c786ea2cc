"""Continuous learning for hours."""
