"""What can be learned at all, from what, and the floor."""
