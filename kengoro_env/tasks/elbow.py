"""Elbow: the elbow with its three muscles reaches one angle after the other."""

from __future__ import annotations

from math import radians

import numpy as np

from kengoro_env.tasks.reach import Reach
from kengoro_env.types import Floats

LARGEST = radians(100.0)
"""Angles are sampled from 0 to this angle, as far as the joint's range allows [rad]."""


def _sample(rng: np.random.Generator, lower: Floats, upper: Floats) -> Floats:
    least, most = np.clip((0.0, LARGEST), lower[0], upper[0])
    return rng.uniform(least, most, 1)


def elbow_task() -> Reach:
    """The task of ``Kengoro/Elbow-v0``."""
    return Reach("mjcf/kengoro_arm/elbow.xml", has_camera=False, sample=_sample)
