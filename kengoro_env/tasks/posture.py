"""Posture: head and right arm reach postures of the posture set, one after the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kengoro_env.postures import posture_set
from kengoro_env.tasks.reach import Reach


def _sample(rng: np.random.Generator) -> NDArray[np.float64]:
    postures = posture_set()
    return postures[rng.integers(len(postures))].copy()


def posture_task() -> Reach:
    """The task of ``Kengoro/Posture-v0``."""
    return Reach("mjcf/kengoro_arm/posture.xml", has_camera=True, sample=_sample)
