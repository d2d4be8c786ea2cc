"""A diagnosis as a prior for training: policies trained on what a robot may be."""
