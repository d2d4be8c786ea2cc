"""Robots and evaluations that several experiments share."""
