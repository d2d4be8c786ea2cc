"""Input: reads STUDY.yaml, logs and bags, converts units, and checks them against the model."""
