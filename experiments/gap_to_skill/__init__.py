"""A diagnosis of one minute of motion, as initial map of the agent."""
