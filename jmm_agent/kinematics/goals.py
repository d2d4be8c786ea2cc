"""Goals of inverse kinematics: residuals of joint angles, with their Jacobians, for `minimise`."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jmm_agent.kinematics.pinocchio_model import KinematicsError
from jmm_agent.kinematics.relative_frames import RelativeFrames, finite
from jmm_agent.types import Floats

RIGID_TOLERANCE = 1e-6
"""Largest deviation of a rotation matrix times its transpose from the identity."""
LEAST_DISTANCE = 1e-6
"""Least distance of a point from the camera that is pointed at it [m]."""


class PoseGoal:
    """A frame shall have a pose: residual root(W) e.

    The error e = (offset of the origin [m], rotation vector [rad]) is from the target, in the
    target's axes. Its halves are not joined to a twist, so that a weight on one does not act on
    the other.

    Args:
        frames: the frames of the arm.
        frame: number of the frame that moves.
        reference: number of the frame in which the target is given; None: world.
        pose_target: the pose to reach (4, 4).
        weights: diagonal of W (6,).

    Raises:
        KinematicsError: the target is no rigid pose, or the weights are negative, all zero, not
            finite or of another shape.
    """

    def __init__(
        self,
        frames: RelativeFrames,
        frame: int,
        reference: int | None,
        pose_target: ArrayLike,
        weights: ArrayLike,
    ) -> None:
        target = _rigid(pose_target)
        weight = finite("weights", weights, (6,))
        if (weight < 0).any() or not weight.any():
            raise KinematicsError("IK: weights must be zero or positive, and not all zero.")
        self._frames, self._ends = frames, (frame, reference)
        self._turned, self._origin = target[:3, :3].T, target[:3, 3]
        self._root, self._weighted = np.sqrt(weight), weight > 0

    def __call__(self, q: Floats) -> tuple[Floats, Floats]:
        """Residual (6,) at joint angles (n,) [rad], and its Jacobian (6, n)."""
        relative = self._frames.relative(q, *self._ends)
        rotation = self._turned @ relative.rotation
        jacobian = self._frames.jacobian(*self._ends, relative)
        offset = self._turned @ (relative.translation - self._origin)
        error = np.concatenate([offset, pin.log3(rotation)])
        slope = np.concatenate([rotation @ jacobian[:3], pin.Jlog3(rotation) @ jacobian[3:]])
        return self._root * error, self._root[:, None] * slope[:, self._frames.column]

    def errors(self, q: Floats) -> tuple[float, float]:
        """Distance [m] and angle [rad] along the weighted axes at joint angles (n,) [rad]."""
        root = np.where(self._weighted, self._root, 1.0)
        error = np.where(self._weighted, self(q)[0] / root, 0.0)
        return float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))


class PointingGoal:
    """The axis (z) of a camera shall point at a point: residual (2,) [rad].

    Args:
        frames: the frames of the arm.
        camera: number of the camera's frame.
        point: in the world (3,) [m].

    Raises:
        KinematicsError: the point is not finite or of another shape.
    """

    def __init__(self, frames: RelativeFrames, camera: int, point: ArrayLike) -> None:
        self._frames, self._camera = frames, camera
        self._point = finite("point", point, (3,))

    def __call__(self, q: Floats) -> tuple[Floats, Floats]:
        """Rotation vector (2,) [rad] from the axis to the point, and its Jacobian (2, n).

        Raises:
            KinematicsError: the point lies in the camera's centre.
        """
        eye = self._frames.relative(q, self._camera, None)
        seen = eye.actInv(self._point)
        distance = float(np.linalg.norm(seen))
        if distance < LEAST_DISTANCE:
            raise KinematicsError("point_camera: the point lies in the camera's centre.")
        x, y, z = seen / distance
        sine = np.hypot(x, y)
        angle = np.arctan2(sine, z)
        error = angle * np.array([-y, x]) / sine if sine > 0 else np.array([angle, 0.0])
        jacobian = self._frames.jacobian(self._camera, None, eye)[:, self._frames.column]
        swing = np.cross(seen, jacobian[:3].T).T / distance**2 + jacobian[3:]
        return error, -swing[:2]


def _rigid(pose: ArrayLike) -> Floats:
    matrix = finite("pose_target", pose, (4, 4))
    rotation = matrix[:3, :3]
    skew = np.abs(rotation @ rotation.T - np.eye(3)).max()
    if skew > RIGID_TOLERANCE or np.linalg.det(rotation) < 0 or np.any(matrix[3] != (0, 0, 0, 1)):
        raise KinematicsError("IK: pose_target must be a rotation, a translation, and (0 0 0 1).")
    return matrix
