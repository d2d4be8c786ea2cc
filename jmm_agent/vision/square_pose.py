"""Pose of a square from its four corners: IPPE's two solutions, and the better one refined.

OpenCV's rotation vectors fail at half a turn, the rotation of an upright marker that faces the
camera. So poses are computed in a frame that is turned in steps of 90 deg until it is nearly level
with the camera (x right, y down, z forward).
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from jmm_agent.types import Floats

ALIKE = 2.0
"""Two solutions fit alike if their errors differ by less than this factor [1] ..."""
NOISE_PX = 0.03
"""... or if both errors are below this [px] ..."""
NOISE_DEVIATIONS = 2.0
"""... or below this number of standard deviations of a corner."""
LEVEL_IN_MARKER = [
    np.array([[c, -s, 0, 0], [-s, -c, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1.0]])
    for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))
]
"""Pose of the level frame in the marker's (4, 4), by the first corner in the image."""


class SquarePose(NamedTuple):
    """Pose of a square (4, 4), and IPPE's other one; RMS distance of the corners from both [px]."""

    pose: Floats
    error_px: float
    flipped: Floats
    flipped_error_px: float


def square_corners(side: float) -> Floats:
    """Corners (4, 3) of a square in the marker's frame, in ArUco's and IPPE's order.

    Args:
        side: of the square [m].
    """
    return (
        side
        / 2
        * np.array([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0]])
    )


def solve_square(
    square: Floats,
    corners: Floats,
    matrix: Floats,
    predicted: Floats | None = None,
    deviation_px: float = 0.0,
) -> SquarePose | None:
    """Pose of a square in an ideal camera.

    Args:
        square: its corners (4, 3) [m]; see `square_corners`.
        corners: the same corners in the image (4, 2) [px].
        matrix: intrinsic matrix of the camera (3, 3) [px].
        predicted: pose (4, 4) that decides between solutions that fit alike.
        deviation_px: standard deviation of a corner [px].

    Returns:
        The pose; None if IPPE finds none.
    """
    first = int(np.argmax(np.roll(corners, -1, axis=0)[:, 0] - corners[:, 0]))
    level = LEVEL_IN_MARKER[first]
    image = np.roll(corners, -first, axis=0)[::-1].copy()
    _, turns, shifts, _ = cv2.solvePnPGeneric(
        square, image, matrix, None, flags=cv2.SOLVEPNP_IPPE_SQUARE
    )
    poses = [_pose(turn, shift) @ level.T for turn, shift in zip(turns, shifts, strict=True)]
    poses.sort(key=lambda pose: corner_error(pose, square, corners, matrix))
    if not poses:
        return None
    chosen, flipped = poses[0], poses[-1]
    errors = [corner_error(pose, square, corners, matrix) for pose in (chosen, flipped)]
    if (
        predicted is not None
        and alike(errors[0], errors[1], deviation_px)
        and angle_between(flipped, predicted) < angle_between(chosen, predicted)
    ):
        chosen, flipped = flipped, chosen
    start = chosen @ level
    turn, shift = cv2.solvePnPRefineLM(
        square, image, matrix, None, cv2.Rodrigues(start[:3, :3])[0], start[:3, 3:]
    )
    pose = _pose(turn, shift) @ level.T
    error = corner_error(pose, square, corners, matrix)
    return SquarePose(pose, error, flipped, corner_error(flipped, square, corners, matrix))


def corner_error(pose: Floats, square: Floats, corners: Floats, matrix: Floats) -> float:
    """RMS distance of corners from those of a pose.

    Args:
        pose: of the square (4, 4).
        square: its corners (4, 3) [m].
        corners: (4, 2) [px].
        matrix: intrinsic matrix (3, 3) [px].

    Returns:
        Distance [px]; inf if the square is behind the camera.
    """
    image = matrix @ (pose[:3, :3] @ square.T + pose[:3, 3:])
    if not (np.isfinite(image).all() and (image[2] > 0).all()):
        return float("inf")
    return float(np.sqrt(np.sum((image[:2] / image[2] - corners.T) ** 2) / 4))


def square_covariance(pose: Floats, square: Floats, matrix: Floats, covariance: Floats) -> Floats:
    """Covariance of a pose from the errors of its corners.

    Args:
        pose: of the square (4, 4).
        square: its corners (4, 3) [m].
        matrix: intrinsic matrix of the camera (3, 3) [px].
        covariance: of the corners' coordinates (8, 8) [px^2].

    Returns:
        Covariance (6, 6) of x, y, z [m] and of the rotations about x, y and z [rad], in the axes of
        the camera.
    """
    gain = np.linalg.pinv(corner_slopes(pose, square, matrix))
    turn = np.kron(np.eye(2), pose[:3, :3])
    return np.asarray(turn @ gain @ covariance @ gain.T @ turn.T)


def either_covariance(covariance: Floats, pose: Floats, other: Floats) -> Floats:
    """Covariance about a pose, if another one is as likely.

    Args:
        covariance: of each of both (6, 6), see `square_covariance`.
        pose: (4, 4).
        other: (4, 4).

    Returns:
        Second moment (6, 6) about ``pose`` of the mixture of both.
    """
    turn = cv2.Rodrigues(other[:3, :3] @ pose[:3, :3].T)[0].ravel()
    apart = np.concatenate([other[:3, 3] - pose[:3, 3], turn])
    return covariance + np.outer(apart, apart) / 2


def corner_slopes(pose: Floats, square: Floats, matrix: Floats) -> Floats:
    """Slopes of N corners (2 N, 6) [px] by offset [m] and rotation vector [rad] in its own axes.

    Args:
        pose: of the square, or of another body (4, 4).
        square: its corners (N, 3) [m].
        matrix: intrinsic matrix of the camera (3, 3) [px].
    """
    x, y, z = (square @ pose[:3, :3].T + pose[:3, 3]).T
    slopes = np.zeros((len(square), 2, 3))
    slopes[:, 0, 0], slopes[:, 0, 2] = matrix[0, 0] / z, -matrix[0, 0] * x / z**2
    slopes[:, 1, 1], slopes[:, 1, 2] = matrix[1, 1] / z, -matrix[1, 1] * y / z**2
    slopes = slopes @ pose[:3, :3]
    turns = np.cross(np.eye(3)[None], square[:, None])  # a row of the displacements of each axis
    both = np.concatenate([slopes, slopes @ turns.transpose(0, 2, 1)], axis=2)
    return both.reshape(-1, 6)


def alike(error: float, other: float, deviation_px: float = 0.0) -> bool:
    """Whether two solutions with these errors [px] fit alike.

    Args:
        error: of the one [px].
        other: of the other [px].
        deviation_px: standard deviation of a corner [px].
    """
    noise = max(NOISE_PX, NOISE_DEVIATIONS * deviation_px)
    return max(error, other) < max(noise, ALIKE * min(error, other))


def angle_between(pose: Floats, other: Floats) -> float:
    """Angle between the orientations of two poses (4, 4), or of two rotations (3, 3) [rad]."""
    return float(np.arccos(np.clip((np.trace(pose[:3, :3].T @ other[:3, :3]) - 1) / 2, -1, 1)))


def _pose(turn: np.ndarray, shift: np.ndarray) -> Floats:
    """Pose (4, 4) from a rotation vector (3, 1) and a translation (3, 1)."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(turn)[0], shift[:, 0]
    return pose
