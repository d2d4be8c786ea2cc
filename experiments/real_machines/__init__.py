"""Diagnosis of measured machines, beside models that a person would fit to the same logs."""
