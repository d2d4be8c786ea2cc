"""The judge of the hand detector: frames of its own, with the truth, and what is counted."""
