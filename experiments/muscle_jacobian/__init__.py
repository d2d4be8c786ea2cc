"""Smoothness of the moment arms of the map (Fig. 7)."""
