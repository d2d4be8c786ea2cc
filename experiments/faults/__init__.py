"""Faults during learning: detection, and effect on the map."""
