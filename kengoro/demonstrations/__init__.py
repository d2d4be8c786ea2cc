"""Demonstrations: grasps of the learning agent, as data sets for those who train policies."""
