"""Trials of the diagnosis on machines of all kinds and sizes with hidden effects."""
