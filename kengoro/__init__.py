"""Robot, agent and diagnosis together: what scripts need to join them."""
