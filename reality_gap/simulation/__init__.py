"""What a hypothesis predicts: the model with its effects, simulated along a log."""
