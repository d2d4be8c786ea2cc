"""Policies cloned from demonstrations of grasps: their inputs, training and judgement."""
