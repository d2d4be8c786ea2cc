"""Robots, agents and evaluations that several experiments share."""
