"""Other methods that learn from the same measurements."""
