"""Forward and inverse kinematics of the drawing (Kawaharazuka et al. 2018, sec. III-C), Pinocchio.

All poses and Jacobians may be relative to another moving frame: the camera on the head and the
marker on the hand both move with the joints.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jmm_agent.kinematics.bounded_least_squares import Minimum, minimise
from jmm_agent.kinematics.pinocchio_model import KinematicsError, load_model
from jmm_agent.types import Floats

__all__ = ["ArmKinematics", "IkResult", "KinematicsError"]


RIGID_TOLERANCE = 1e-6  # of a rotation matrix times its transpose
LIMIT_TOLERANCE = 1e-9  # [rad]
LEAST_DISTANCE = 1e-6  # [m] of a point that a camera looks at
RESTART_SEED = 0


class IkResult(NamedTuple):
    """What inverse kinematics found.

    Attributes:
        q: joints, shape (n,) [rad], inside the limits.
        converged: the search ended in a minimum and both errors are within tolerance.
        position_error: distance to the target along the weighted axes [m].
        rotation_error: angle to the target about the weighted axes [rad].
        iterations: steps of the search.
        reason: one sentence.
    """

    q: Floats
    converged: bool
    position_error: float
    rotation_error: float
    iterations: int
    reason: str


class ArmKinematics:
    """Kinematics of some joints of an MJCF file; every other joint is locked.

    Frames are the file's sites, bodies and cameras. Cameras are in OpenCV's convention (x right,
    y down, z forward), which is MuJoCo's turned by half a turn about x.

    Args:
        mjcf_path: the drawing.
        joints: the n joints, in the order of every q.
        locked: angles of other joints [rad]; zero where left out.

    Raises:
        KinematicsError: the file is missing or broken, or a joint is unknown.
    """

    def __init__(
        self,
        mjcf_path: str | os.PathLike[str],
        joints: Sequence[str],
        locked: Mapping[str, float] | None = None,
    ) -> None:
        self.joints = tuple(joints)
        self._model, names, self._frames = load_model(mjcf_path, self.joints, locked or {})
        self._data = self._model.createData()
        self._rank = np.array([self.joints.index(name) for name in names])
        self._column = np.argsort(self._rank)
        if self._model.nq != len(names) or self._model.nv != len(names):
            raise KinematicsError("Kinematics: every joint must be a hinge or a slide.")
        self.limits: Floats = np.column_stack(
            [self._model.lowerPositionLimit, self._model.upperPositionLimit]
        )[self._column]
        self.limits.setflags(write=False)

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of all frames."""
        return tuple(self._frames)

    def pose(self, frame: str, q: ArrayLike, relative_to: str | None = None) -> Floats:
        """Pose of `frame` in `relative_to` (None: world) at `q` (n,) [rad]; shape (4, 4)."""
        ends = self._frame(frame), self._frame(relative_to)
        pin.computeJointJacobians(self._model, self._data, self._posture(q)[self._rank])
        return np.array(self._relative(*ends).homogeneous)

    def frame_jacobian(self, frame: str, q: ArrayLike, relative_to: str | None = None) -> Floats:
        """Twist of `frame` against `relative_to`, in the axes of `frame`, per joint: (6, n).

        Rows 0 to 2: velocity of the origin [m/rad]; rows 3 to 5: angular velocity [rad/rad].
        """
        ends = self._frame(frame), self._frame(relative_to)
        pin.computeJointJacobians(self._model, self._data, self._posture(q)[self._rank])
        return self._jacobian(*ends, self._relative(*ends))[:, self._column]

    def solve(
        self,
        frame: str,
        pose_target: ArrayLike,
        q_start: ArrayLike,
        relative_to: str | None = None,
        weights: ArrayLike = (1.0,) * 6,
        prior_precision: ArrayLike | None = None,
        free: ArrayLike | None = None,
        position_tolerance: float = 1e-3,
        rotation_tolerance: float = 1e-2,
        max_iterations: int = 200,
        restarts: int = 0,
    ) -> IkResult:
        """Joints that bring `frame` to `pose_target` in `relative_to`, joint limits kept.

        Minimises e' W e + (q - q_start)' L (q - q_start), e = (offset of the origin [m], rotation
        vector [rad]) from the target, in the target's axes; not joined to a twist, so that a
        weight on one does not act on the other. With W = 1 / variance of the seen pose and L =
        inverse covariance of the estimate this is the likeliest posture (covariance-weighted IK).

        Args:
            frame: the moving frame.
            pose_target: its pose to reach, (4, 4).
            q_start: where to start, (n,) [rad]; clipped into the limits.
            relative_to: the frame the target is given in; None: world.
            weights: diagonal of W, (6,); zero for an axis that does not matter.
            prior_precision: L, (n,) or (n, n) [1/rad^2]; None: zero.
            free: mask of the joints that may move, (n,); None: all.
            position_tolerance: largest position error of a converged result [m].
            rotation_tolerance: largest rotation error of a converged result [rad].
            max_iterations: of each search.
            restarts: searches from other postures of the box when the first does not converge;
                always the same ones.

        Raises:
            KinematicsError: an unknown frame, a wrong shape, something not finite, no rigid pose.
        """
        ends = self._frame(frame), self._frame(relative_to)
        target = _rigid(pose_target)
        turned, origin = target[:3, :3].T, target[:3, 3]
        weight = _finite("weights", weights, (6,))
        if (weight < 0).any() or not weight.any():
            raise KinematicsError("IK: weights must be zero or positive, and not all zero.")
        low, high, start = self._box(q_start, free)
        precision = self._precision(prior_precision)
        root = np.sqrt(weight)

        def residual(q: Floats) -> tuple[Floats, Floats]:
            pin.computeJointJacobians(self._model, self._data, q[self._rank])
            relative = self._relative(*ends)
            rotation = turned @ relative.rotation
            jacobian = self._jacobian(*ends, relative)
            error = np.concatenate([turned @ (relative.translation - origin), pin.log3(rotation)])
            slope = np.concatenate([rotation @ jacobian[:3], pin.Jlog3(rotation) @ jacobian[3:]])
            return root * error, root[:, None] * slope[:, self._column]

        def judged(found: Minimum) -> IkResult:
            weighted = weight > 0
            error = np.where(weighted, residual(found.x)[0] / np.where(weighted, root, 1.0), 0.0)
            errors = float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))
            good = errors[0] <= position_tolerance and errors[1] <= rotation_tolerance
            reason = self._reason(found, good, *errors, low, high)
            return IkResult(found.x, good and found.stationary, *errors, found.iterations, reason)

        random = np.random.default_rng(RESTART_SEED)
        best = judged(minimise(residual, start, low, high, precision, max_iterations))
        for _ in range(restarts):
            if best.converged:
                break
            other = random.uniform(low, high)
            found = minimise(residual, other, low, high, precision, max_iterations, centre=start)
            best = min(best, judged(found), key=lambda r: (not r.converged, r.position_error))
        return best

    def look_at(
        self, camera: str, point: ArrayLike, q_start: ArrayLike, joints: Sequence[str]
    ) -> IkResult:
        """Turn `joints` until the axis (z) of `camera` points at `point` (3,) [m, world].

        The least movement from `q_start` (n,) [rad] that does it, joint limits kept; the
        rotation error is the angle between axis and point.

        Raises:
            KinematicsError: as `solve`, or the point lies in the camera.
        """
        end = self._frame(camera)
        goal = _finite("point", point, (3,))
        for joint in joints:
            if joint not in self.joints:
                raise KinematicsError(f"look_at: unknown joint {joint!r}; joints: {self.joints}.")
        low, high, start = self._box(q_start, [name in joints for name in self.joints])

        def residual(q: Floats) -> tuple[Floats, Floats]:
            pin.computeJointJacobians(self._model, self._data, q[self._rank])
            eye = self._relative(end, None)
            seen = eye.actInv(goal)
            distance = float(np.linalg.norm(seen))
            if distance < LEAST_DISTANCE:
                raise KinematicsError("look_at: the point lies in the camera's centre.")
            x, y, z = seen / distance
            sine = np.hypot(x, y)
            angle = np.arctan2(sine, z)
            error = angle * np.array([-y, x]) / sine if sine > 0 else np.array([angle, 0.0])
            jacobian = self._jacobian(end, None, eye)[:, self._column]
            swing = np.cross(seen, jacobian[:3].T).T / distance**2 + jacobian[3:]
            return error, -swing[:2]

        found = minimise(residual, start, low, high, np.zeros((start.size,) * 2), 100)
        angle = float(np.linalg.norm(residual(found.x)[0]))
        reason = self._reason(found, angle <= 1e-3, 0.0, angle, low, high)
        return IkResult(found.x, angle <= 1e-3, 0.0, angle, found.iterations, reason)

    def unobservable_subspace(
        self,
        frame: str,
        q: ArrayLike,
        relative_to: str | None = None,
        weights: ArrayLike = (1.0,) * 6,
        threshold: float = 1e-6,
    ) -> Floats:
        """Directions of joint space that the pose of `frame` in `relative_to` does not show.

        Singular vectors of sqrt(W) J with singular values below `threshold`: orthonormal rows,
        shape (k, n), k >= n - 6; the least seen direction last.
        """
        root = np.sqrt(_finite("weights", weights, (6,)))
        jacobian = root[:, None] * self.frame_jacobian(frame, q, relative_to)
        _, values, vectors = np.linalg.svd(jacobian)
        return vectors[int(np.sum(values >= threshold)) :]

    def _frame(self, name: str | None) -> Any:
        if name is None:
            return None
        if name not in self._frames:
            raise KinematicsError(f"Kinematics: unknown frame {name!r}; frames: {self.frames}.")
        return self._frames[name]

    def _posture(self, q: ArrayLike) -> Floats:
        return _finite("q", q, (len(self.joints),))

    def _relative(self, frame: int, reference: int | None) -> Any:
        pose = pin.updateFramePlacement(self._model, self._data, frame)
        if reference is None:
            return pose
        return pin.updateFramePlacement(self._model, self._data, reference).actInv(pose)

    def _jacobian(self, frame: int, reference: int | None, relative: Any) -> Floats:
        """(6, n) in Pinocchio's order of joints; `relative` is the pose of the one in the other."""
        local = pin.ReferenceFrame.LOCAL
        jacobian = pin.getFrameJacobian(self._model, self._data, frame, local)
        if reference is None:
            return jacobian
        other = pin.getFrameJacobian(self._model, self._data, reference, local)
        return jacobian - relative.toActionMatrixInverse() @ other

    def _box(self, q_start: ArrayLike, free: ArrayLike | None) -> tuple[Floats, Floats, Floats]:
        low, high = self.limits.T
        start = np.clip(self._posture(q_start), low, high)
        if free is None:
            return low, high, start
        mask = np.asarray(free, dtype=bool)
        if mask.shape != start.shape or not mask.any():
            raise KinematicsError(f"IK: free must be {start.size} flags, one of them set.")
        return np.where(mask, low, start), np.where(mask, high, start), start

    def _precision(self, prior: ArrayLike | None) -> Floats:
        n = len(self.joints)
        if prior is None:
            return np.zeros((n, n))
        given = np.asarray(prior, dtype=float)
        matrix = np.diag(given) if given.shape == (n,) else given
        return _finite("prior_precision", matrix, (n, n))

    def _reason(
        self, found: Minimum, good: bool, metres: float, angle: float, low: Floats, high: Floats
    ) -> str:
        if good and found.stationary:
            return "Reached."
        miss = f"{1e3 * metres:.1f} mm and {np.rad2deg(angle):.1f} deg"
        if not found.stationary:
            return f"Not settled after {found.iterations} iterations, {miss} from the target."
        at_limit = (found.x <= low + LIMIT_TOLERANCE) | (found.x >= high - LIMIT_TOLERANCE)
        pairs = zip(self.joints, at_limit & (low < high), strict=True)
        names = ", ".join(joint for joint, held in pairs if held)
        return (
            f"Out of reach from this start: the closest posture misses by {miss}; "
            f"joints at their limits: {names or 'none'}."
        )


def _finite(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Floats:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    if array.shape != shape or not np.isfinite(array).all():
        raise KinematicsError(f"Kinematics: {name} must be finite numbers of shape {shape}.")
    return array


def _rigid(pose: ArrayLike) -> Floats:
    matrix = _finite("pose_target", pose, (4, 4))
    rotation = matrix[:3, :3]
    skew = np.abs(rotation @ rotation.T - np.eye(3)).max()
    if skew > RIGID_TOLERANCE or np.linalg.det(rotation) < 0 or np.any(matrix[3] != (0, 0, 0, 1)):
        raise KinematicsError("IK: pose_target must be a rotation, a translation, and (0 0 0 1).")
    return matrix
