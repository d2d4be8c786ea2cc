"""Faults in the middle of learning are named and outlived."""
