"""Experiment of clocks: learning with time stamps that are not exact."""
