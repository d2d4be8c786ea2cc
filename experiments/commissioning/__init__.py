"""Commissioning runs of robots with and without faults."""
