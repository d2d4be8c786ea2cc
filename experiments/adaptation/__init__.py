"""Muscles elongate for good, and learning makes up for it (claim of sec. I)."""
