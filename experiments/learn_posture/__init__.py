"""Reinforcement learning of postures from the reward alone."""
