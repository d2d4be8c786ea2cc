"""Pose of known points from uncertain pixels of them, with its covariance.

The distance r_i of a point's measured slopes (x/z, y/z) from those of the pose has a t distribution
with the scale S_i, so that far points count less. The pose of the largest likelihood minimises
sum_i log(1 + r_i' S_i^-1 r_i / TAIL); Gauss-Newton steps with weights find it from the solution of
OpenCV's SQPnP. Its covariance is the inverse of Fisher's information.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from jmm_agent.types import Floats

STEPS = 20
"""Largest number of Gauss-Newton steps."""
CONVERGED = 1e-7
"""Step [m, rad] at which they end."""
NEAREST = 0.02
"""Points must be farther from the camera than this [m]."""
TAIL = 4.0
"""Degrees of freedom of the t distribution of a point's error."""


class PointsPose(NamedTuple):
    """A pose from points.

    Attributes:
        pose: of the points' axes in the camera (4, 4).
        covariance: (6, 6), see `pose_covariance`.
    """

    pose: Floats
    covariance: Floats


def solve_points(points: Floats, slopes: Floats, covariances: Floats) -> PointsPose | None:
    """The pose at which points have measured slopes; None if there is none before the camera.

    Args:
        points: (n, 3) [m], in their own axes; n >= 4.
        slopes: measured (n, 2) [1].
        covariances: scales of the slopes' errors (n, 2, 2).
    """
    try:
        whitening = np.linalg.inv(np.linalg.cholesky(covariances))
    except np.linalg.LinAlgError:  # a scale that is not positive definite
        return None
    start = _start(points, slopes)
    if start is None:
        return None
    rotation, position = start
    for _ in range(STEPS):
        residual, jacobian = _residuals(points, slopes, whitening, rotation, position)
        weights = np.sqrt((TAIL + 2.0) / (TAIL + (residual**2).sum(axis=1)))
        weighted = (jacobian * weights[:, None, None]).reshape(-1, 6)
        matrix = weighted.T @ weighted + 1e-9 * np.eye(6)
        step = np.linalg.solve(matrix, weighted.T @ (residual * weights[:, None]).ravel())
        position = position + step[:3]
        rotation = cv2.Rodrigues(step[3:])[0] @ rotation
        if (points @ rotation[2] + position[2]).min() < NEAREST:
            return None
        if np.abs(step).max() < CONVERGED:
            break
    _, jacobian = _residuals(points, slopes, whitening, rotation, position)
    # Fisher's information of a t distribution, over that of a normal one with the same scale.
    share = (TAIL + 2.0) / (TAIL + 4.0)
    information = share * np.einsum("nij,nik->jk", jacobian, jacobian)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, position
    return PointsPose(pose, np.linalg.inv(information + 1e-6 * np.eye(6)))


def _start(points: Floats, slopes: Floats) -> tuple[Floats, Floats] | None:
    try:
        found, vector, position = cv2.solvePnP(
            points, slopes, np.eye(3), None, flags=cv2.SOLVEPNP_SQPNP
        )
    except cv2.error:  # all points at one place, or slopes that are not finite
        return None
    if not found or not np.isfinite(position).all():
        return None
    rotation = np.asarray(cv2.Rodrigues(vector)[0], dtype=float)
    if (points @ rotation[2] + position[2]).min() < NEAREST:
        return None
    return rotation, np.asarray(position, dtype=float).ravel()


def _residuals(
    points: Floats, slopes: Floats, whitening: Floats, rotation: Floats, position: Floats
) -> tuple[Floats, Floats]:
    """Whitened distances (n, 2) and minus their derivatives by the pose (n, 2, 6)."""
    turned = points @ rotation.T
    x, y, z = (turned + position).T
    zero, inverse = np.zeros_like(z), 1.0 / z
    by_position = np.stack(
        [
            np.stack([inverse, zero, -x * inverse**2], axis=-1),
            np.stack([zero, inverse, -y * inverse**2], axis=-1),
        ],
        axis=1,
    )
    by_rotation = np.cross(turned[:, None, :], by_position)
    residual = slopes - np.stack([x, y], axis=-1) * inverse[:, None]
    jacobian = np.concatenate([by_position, by_rotation], axis=2)
    return (
        np.einsum("nij,nj->ni", whitening, residual),
        np.einsum("nij,njk->nik", whitening, jacobian),
    )
