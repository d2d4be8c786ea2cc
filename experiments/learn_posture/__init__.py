"""Reinforcement learning of Posture, from the reward alone."""
