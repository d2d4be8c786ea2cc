"""A can that was missed is grasped (Figs. 12 to 14)."""
