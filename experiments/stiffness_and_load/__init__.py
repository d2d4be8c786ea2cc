"""Stiffness and load: postures that soft muscles hold, and the stiffness that a push shows."""
