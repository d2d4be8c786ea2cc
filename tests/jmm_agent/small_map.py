"""A small random map: two groups that share a joint, joints and muscles interleaved."""

from __future__ import annotations

import numpy as np

from jmm_agent.mapping.group_map import GroupMap
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap

JOINTS = ("a", "b", "c", "d")
MUSCLES = ("m0", "m1", "m2", "m3", "m4")
LIMITS = np.array([[-1.0, 0.5], [-0.3, 1.2], [-0.6, 0.6], [0.1, 1.5]])


def make_map(seed: int = 0, hidden: int = 12) -> JointMuscleMap:
    """The map; lengths of some 10 mm."""
    rng = np.random.default_rng(seed)

    def group(name: str, joints: list[int], muscles: list[int]) -> GroupMap:
        n, k = len(joints), len(muscles)
        return GroupMap(
            name,
            np.array(joints),
            np.array(muscles),
            rng.normal(size=n),
            rng.uniform(0.5, 2.0, n),
            rng.normal(size=(hidden, n)),
            rng.normal(size=hidden),
            20.0 * rng.normal(size=(k, hidden)),
            rng.normal(size=k),
        )

    groups = (group("near", [1, 0], [3, 0]), group("far", [3, 1, 2], [1, 4, 2]))
    return JointMuscleMap(JOINTS, MUSCLES, groups)


def postures(count: int, seed: int = 0) -> np.ndarray:
    """Postures (count, 4) [rad] inside the limits."""
    low, high = LIMITS.T
    return np.random.default_rng([seed, 77]).uniform(low, high, (count, 4))
