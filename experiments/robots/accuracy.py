"""Accuracy of a map: its error against the muscle lengths of the robot."""

from __future__ import annotations

import numpy as np

from experiments.robots.evaluation import map_error_mm, own_lengths
from jmm_agent.agent import Agent
from kengoro.trained_maps import ARM
from kengoro_env.assets import asset_path
from kengoro_env.departures import actual
from kengoro_env.postures import posture_set
from kengoro_env.robot.robot import Robot


class MapAccuracy:
    """Error of maps against the muscle lengths of an actual robot at sampled postures.

    Args:
        seed: of the robot.
        count: number of postures.
    """

    def __init__(self, seed: int, count: int) -> None:
        rng = np.random.default_rng([seed, 8])
        self._postures = rng.permutation(posture_set())[:count]
        self._lengths = own_lengths(Robot(asset_path(ARM), actual(seed)), self._postures, rng)

    def error_mm(self, agent: Agent) -> float:
        """Median over postures of the RMS over muscles of the error of the agent's map [mm]."""
        return map_error_mm(agent.map, self._postures, self._lengths)
