"""An agent drives a robot in another process."""
