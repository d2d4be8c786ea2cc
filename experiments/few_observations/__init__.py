"""Few observations: errors after the first looks at the hand, and without any."""
