"""Muscles elongate permanently, and learning compensates for it (claim of sec. I)."""
