"""A minute of motion, diagnosed, as the map that the agent begins with."""
