"""Trials of the diagnosis on machines with hidden effects."""
