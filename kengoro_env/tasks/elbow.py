"""Elbow: the elbow with its three muscles reaches one angle after the other."""

from __future__ import annotations

from math import radians

import numpy as np
from numpy.typing import NDArray

from kengoro_env.tasks.reach import Reach

LARGEST = radians(100.0)
"""Angles are sampled from 0 to this angle [rad]."""


def _sample(rng: np.random.Generator) -> NDArray[np.float64]:
    return rng.uniform(0.0, LARGEST, 1)


def elbow_task() -> Reach:
    """The task of ``Kengoro/Elbow-v0``."""
    return Reach("mjcf/kengoro_arm/elbow.xml", has_camera=False, sample=_sample)
