"""What looks at the hand do not show: one look has 6 numbers, the arm 14 joints."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.robots.world import EYE, MARKER, World

POSTURES = 100
DIRECTIONS = 6
LARGE = 0.2  # share of a direction from which a joint is named
MILLIMETRE_PER_RADIAN = 1e3


def unseen(world: World) -> dict[str, Any]:
    """The subspace that one look leaves open, and directions that many looks hardly see.

    Returns:
        `one_look_share`: by joint, which share of its movement (squared) lies in the subspace that
        one look does not see, mean over postures; 1 means never seen, 0 always seen alone.
        `one_look_dimensions`: of that subspace.
        `many_looks`: constant errors of the joints, the same at all postures, that move the marker
        least: by how much [mm, deg RMS] for 1 deg, and the joints that take part.
    """
    joints, kinematics = world.arm.joints, world.kinematics
    postures = world.postures[:POSTURES]
    share, dimensions = np.zeros(len(joints)), []
    for q in postures:
        rows = kinematics.unobservable_subspace(MARKER, q, relative_to=EYE)
        share += np.sum(rows**2, axis=0) / len(postures)
        dimensions.append(len(rows))
    slopes = np.array([kinematics.frame_jacobian(MARKER, q, relative_to=EYE) for q in postures])
    _, _, vectors = np.linalg.svd(slopes.reshape(-1, len(joints)))
    return {
        "one_look_share": dict(zip(joints, np.round(share, 3).tolist(), strict=True)),
        "one_look_dimensions": [min(dimensions), max(dimensions)],
        "many_observations": [
            _told(world, slopes, vector) for vector in vectors[: -DIRECTIONS - 1 : -1]
        ],
    }


def _told(world: World, slopes: np.ndarray, vector: np.ndarray) -> dict[str, Any]:
    """How much a constant error of 1 deg along a direction (n,) moves the marker in its looks."""
    moves = np.radians(1.0) * slopes @ vector  # (K, 6)
    size = np.sqrt(np.mean([np.sum(moves[:, :3] ** 2, 1), np.sum(moves[:, 3:] ** 2, 1)], axis=1))
    pairs = zip(world.arm.joints, vector, strict=True)
    named = sorted(pairs, key=lambda pair: -abs(pair[1]))
    return {
        "mm_per_deg": round(float(MILLIMETRE_PER_RADIAN * size[0]), 3),
        "deg_per_deg": round(float(np.degrees(size[1])), 3),
        "joints": {joint: round(float(x), 2) for joint, x in named if abs(x) >= LARGE},
    }
