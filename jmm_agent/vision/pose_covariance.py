"""Covariance of a measured pose: what is accepted, and the weight that it has in a fit.

A pose measured as (p, R) differs from the true one by dp = p - p_true [m] and by the rotation
vector phi [rad] of R R_true'. Both are in the fixed axes of the reference frame, in the order
(x, y, z, rotation about x, about y, about z), as in ROS's ``PoseWithCovariance``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats

UNKNOWN = 1e4
"""Variance [m^2, rad^2] from which on a number counts as not measured."""
FINEST = 1e-16
"""Least variance of a measurement [m^2, rad^2]: 10 nm, 10 nrad."""
ASYMMETRY = 1e-6
"""Largest difference between two elements that must be equal, relative to the variances [1]."""
RIGID = 1e-3
"""Largest deviation of the columns of a rotation from unit length and right angles [1]."""


def checked_pose(value: ArrayLike) -> Floats:
    """A rigid pose (4, 4), its rotation made orthonormal.

    Args:
        value: homogeneous matrix, translation in metres.

    Raises:
        AgentError: wrong shape, not finite, or not a rotation and a translation.
    """
    pose = numbers("pose", value, (4, 4))
    if not np.isfinite(pose).all():
        raise AgentError("A measured pose must be finite; it has NaN or infinite numbers.")
    rotation = pose[:3, :3]
    square = np.abs(rotation.T @ rotation - np.eye(3)).max() <= RIGID
    if not (square and np.linalg.det(rotation) > 0 and np.allclose(pose[3], [0, 0, 0, 1])):
        raise AgentError(
            "A measured pose must be a homogeneous matrix: a right-handed rotation in rows and "
            "columns 0 to 2, the position [m] in column 3, and (0, 0, 0, 1) in row 3."
        )
    left, _, right = np.linalg.svd(rotation)
    pose[:3, :3] = left @ right
    return pose


def checked_covariance(value: ArrayLike) -> Floats:
    """A covariance (6, 6) [m^2, rad^2] in the axes of the reference frame (module docstring).

    Args:
        value: symmetric matrix. An infinite variance, or one of `UNKNOWN` and more, says that this
            number was not measured; the other elements of its row and column are not used.
            Rotations are measured about all axes or about none.

    Returns:
        The matrix; what was not measured has the variance `UNKNOWN`.

    Raises:
        AgentError: wrong shape, NaN, not symmetric, not positive definite, nothing measured, or a
            rotation measured about some axes only.
    """
    covariance = numbers("covariance", value, (6, 6))
    variances = np.diag(covariance).copy()
    if np.isnan(variances).any():
        raise AgentError("The covariance of a measured pose has NaN on its diagonal.")
    if np.any((variances > 0.0) & (variances < FINEST)):
        raise AgentError(
            f"The covariance of a measured pose has a variance of {variances.min():.3g}; they must "
            f"be at least {FINEST:g} m^2 and rad^2."
        )
    unknown = variances >= UNKNOWN
    if unknown.all():
        raise AgentError("The covariance of a measured pose says that nothing was measured.")
    if unknown[3:].any() and not unknown[3:].all():
        raise AgentError(
            "The covariance of a measured pose must have finite variances for rotations about all "
            "axes, or for none of them (position only)."
        )
    covariance[unknown] = covariance[:, unknown] = 0.0
    covariance[unknown, unknown] = UNKNOWN
    if not np.isfinite(covariance).all():
        raise AgentError("The covariance of a measured pose must be finite beside its diagonal.")
    scale = np.sqrt(np.abs(np.outer(np.diag(covariance), np.diag(covariance))))
    if np.any(np.abs(covariance - covariance.T) > ASYMMETRY * scale):
        raise AgentError("The covariance of a measured pose must be symmetric.")
    covariance = 0.5 * (covariance + covariance.T)
    if np.any(variances <= 0) or not np.linalg.eigvalsh(covariance / scale)[0] > 0:
        raise AgentError(
            "The covariance of a measured pose must be positive definite, in m^2 and rad^2, in the "
            "order x, y, z, rotations about x, y, z."
        )
    return covariance


def measures_rotation(covariance: Floats | None) -> bool:
    """Whether a pose with a covariance (6, 6) has a measured rotation; None: a marker's has."""
    return covariance is None or bool(covariance[3, 3] < UNKNOWN)


def pose_weight(
    covariance: Floats, pose: Floats, position_noise: float, rotation_noise: float
) -> Floats:
    """Inverse covariance (6, 6) of the residual of a measured pose.

    Args:
        covariance: of the pose (6, 6), as `checked_covariance` returns it.
        pose: as measured (4, 4).
        position_noise: standard deviation of what the kinematics miss [m]; added.
        rotation_noise: standard deviation of what the kinematics miss [rad]; added.

    Returns:
        Weight in the axes of the measured pose, those of `MarkerResidual`. Exactly zero for numbers
        that were not measured.
    """
    rotation = block_diag(pose[:3, :3], pose[:3, :3])
    measured = np.diag(covariance) < UNKNOWN
    floor = np.repeat([position_noise**2, rotation_noise**2], 3)
    weight = np.zeros((6, 6))
    inner = np.ix_(measured, measured)
    weight[inner] = np.linalg.inv(covariance[inner] + np.diag(floor[measured]))
    return np.asarray(rotation.T @ weight @ rotation)


def numbers(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """A copy of an array of floats with the given shape.

    Args:
        name: what the array is, for messages.
        value: to copy.
        shape: of the array; empty for a number.

    Raises:
        AgentError: another shape, or no numbers.
    """
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise AgentError(f"The {name} of a measured pose must be numbers.") from None
    if array.shape != shape:
        raise AgentError(
            f"The {name} of a measured pose must be of shape {shape}, got shape {array.shape}."
        )
    return array
