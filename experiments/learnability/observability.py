"""Observability: an observation of the hand has 6 numbers, and the arm 14 joints."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.robots.world import EYE, MARKER, World

POSTURES = 100
"""Number of postures over which is averaged."""
DIRECTIONS = 6
"""Number of poorly observable directions that are listed."""
LARGE = 0.2
"""Least component of a direction for which a joint is listed."""
MILLIMETRE_PER_RADIAN = 1e3


def observability(world: World) -> dict[str, Any]:
    """Subspace that one observation does not determine, and directions that many hardly determine.

    Returns:
        ``one_observation_share``: by joint, the share of its squared movement that lies in the
        subspace that one observation does not determine, mean over postures.
        ``one_observation_dimensions``: smallest and largest dimension of that subspace.
        ``many_observations``: constant errors of the joints that move the marker least: RMS
        movement [mm] and rotation [deg] for 1 deg, and the joints with large components.
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
        "one_observation_share": dict(zip(joints, np.round(share, 3).tolist(), strict=True)),
        "one_observation_dimensions": [min(dimensions), max(dimensions)],
        "many_observations": [
            _direction(world, slopes, vector) for vector in vectors[: -DIRECTIONS - 1 : -1]
        ],
    }


def _direction(world: World, slopes: np.ndarray, vector: np.ndarray) -> dict[str, Any]:
    """Movement of the marker for a constant error of 1 deg along a direction, shape (n,)."""
    moves = np.radians(1.0) * slopes @ vector  # (K, 6)
    size = np.sqrt(np.mean([np.sum(moves[:, :3] ** 2, 1), np.sum(moves[:, 3:] ** 2, 1)], axis=1))
    pairs = zip(world.arm.joints, vector, strict=True)
    named = sorted(pairs, key=lambda pair: -abs(pair[1]))
    return {
        "mm_per_deg": round(float(MILLIMETRE_PER_RADIAN * size[0]), 3),
        "deg_per_deg": round(float(np.degrees(size[1])), 3),
        "joints": {joint: round(float(x), 2) for joint, x in named if abs(x) >= LARGE},
    }
