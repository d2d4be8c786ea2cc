"""Accuracy of new postures with both updaters (Fig. 11)."""
