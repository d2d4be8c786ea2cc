"""Tasks of the environments: goal, reward, success and end of an episode."""
