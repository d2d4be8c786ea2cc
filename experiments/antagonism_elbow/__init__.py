"""Antagonists that fight each other learn to give way (Fig. 9)."""
