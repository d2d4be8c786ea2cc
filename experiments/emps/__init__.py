"""Diagnosis of a measured drive from its force."""
