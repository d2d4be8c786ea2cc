"""A small drawing: the small map, whose arm has invented weights."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from experiments.few_observations.successor_data import Observed
from jmm_agent.types import Floats
from tests.jmm_agent.small_map import LIMITS, make_map, postures


class Arm:
    """Loads that change with the posture."""

    def gravity(self, q: Floats) -> Floats:
        """Torques (n,) [N m]."""
        return np.asarray(0.3 * np.sin(q + np.arange(len(q))))


def small_world() -> Any:
    """What learners need of a world, for 4 joints and 5 muscles."""
    return SimpleNamespace(map=make_map(0), postures=postures(400, 9), arm=Arm(), limits=LIMITS)


def rests(count: int, missed: float, stretch: float = 0.0) -> Observed:
    """Rests of a robot whose lengths miss the drawing by a constant [m] and by tensions [m/N]."""
    world, angles = small_world(), postures(count, 3)
    tensions = np.random.default_rng(4).uniform(30.0, 120.0, (count, 5))
    lengths = world.map.lengths(angles) + missed - stretch * tensions
    torques = np.array([world.arm.gravity(q) for q in angles]).reshape(count, 4)
    return Observed(angles, tensions, lengths, torques)
