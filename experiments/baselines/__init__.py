"""What other methods learn from the same measurements."""
