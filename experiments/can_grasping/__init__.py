"""A can that was missed is grasped after learning (Figs. 12 to 14)."""
