"""Learning beside the control loop: jobs, the workers that run them, and their schedule."""
