"""Behaviour cloning of grasps, from demonstrations of robots that have learned."""
