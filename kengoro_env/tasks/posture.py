"""Posture: head and right arm reach postures of the posture set, one after the other."""

from __future__ import annotations

import numpy as np

from kengoro_env.postures import postures_within
from kengoro_env.tasks.reach import Reach
from kengoro_env.types import Floats


def _sample(rng: np.random.Generator, lower: Floats, upper: Floats) -> Floats:
    postures = postures_within(lower, upper)
    return postures[rng.integers(len(postures))].copy()


def posture_task() -> Reach:
    """The task of ``Kengoro/Posture-v0``."""
    return Reach("mjcf/kengoro_arm/posture.xml", has_camera=True, sample=_sample)
