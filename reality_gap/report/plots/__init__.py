"""Plots: the pictures of a report."""
