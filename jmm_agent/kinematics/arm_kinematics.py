"""Forward and inverse kinematics of the nominal model, by Pinocchio.

All poses and Jacobians may be relative to another moving frame, because the camera on the head and
the marker on the hand both move with the joints. Inverse kinematics serves the Vision Updater and
grasping (Kawaharazuka et al. 2018, sec. III-C and IV).
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jmm_agent.kinematics.bounded_least_squares import Minimum, minimise
from jmm_agent.kinematics.goals import PointingGoal, PoseGoal
from jmm_agent.kinematics.pinocchio_model import KinematicsError
from jmm_agent.kinematics.relative_frames import RelativeFrames, finite
from jmm_agent.types import Floats

__all__ = ["ArmKinematics", "IkOptions", "IkResult", "KinematicsError"]


LIMIT_TOLERANCE = 1e-9
"""Distance from a limit within which a joint is at it [rad]."""
POINTING_TOLERANCE = 1e-3
"""Largest angle between the camera's axis and a point that it is pointed at [rad]."""
POINTING_ITERATIONS = 100
RESTART_SEED = 0


@dataclass(frozen=True)
class IkOptions:
    """How long inverse kinematics searches, and what it accepts.

    Attributes:
        position_tolerance: largest position error of a converged result [m].
        rotation_tolerance: largest rotation error of a converged result [rad].
        max_iterations: largest number of steps of each search.
        restarts: searches from other postures in the joint limits when the first does not
            converge; the postures are the same in each call.
    """

    position_tolerance: float = 1e-3
    rotation_tolerance: float = 1e-2
    max_iterations: int = 200
    restarts: int = 0


class IkResult(NamedTuple):
    """Result of inverse kinematics.

    Attributes:
        q: joint angles (n,) [rad], inside the limits.
        converged: whether the search ended in a minimum with both errors within tolerance.
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

    Frames are the file's sites, bodies and cameras. Cameras follow OpenCV's convention (x right,
    y down, z forward), which is MuJoCo's turned by half a turn about x.

    Args:
        mjcf_path: MJCF file of the nominal model.
        joints: names of the n joints, in the order of every q.
        locked: angles of other joints [rad]; zero where left out.

    Attributes:
        joints: as given.
        limits: lowest and highest angle of each joint (n, 2) [rad], read-only.

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
        self._frames = RelativeFrames(mjcf_path, self.joints, locked or {})
        self.limits = self._frames.limits

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of all frames."""
        return self._frames.names

    def pose(self, frame: str, q: ArrayLike, relative_to: str | None = None) -> Floats:
        """Pose of a frame.

        Args:
            frame: name of the frame.
            q: joint angles (n,) [rad].
            relative_to: name of the frame in which the pose is given; None: world.

        Returns:
            Homogeneous matrix (4, 4), translation in metres.

        Raises:
            KinematicsError: an unknown frame, a wrong shape or an angle that is not finite.
        """
        ends = self._frames.number(frame), self._frames.number(relative_to)
        return np.array(self._frames.relative(self._posture(q), *ends).homogeneous)

    def frame_jacobian(self, frame: str, q: ArrayLike, relative_to: str | None = None) -> Floats:
        """Velocity of a frame against another one, per joint velocity.

        Args:
            frame: name of the frame, in whose axes the velocity is given.
            q: joint angles (n,) [rad].
            relative_to: name of the other frame; None: world.

        Returns:
            Jacobian (6, n): velocity of the origin in rows 0 to 2 [m/rad], angular velocity in rows
            3 to 5 [rad/rad].

        Raises:
            KinematicsError: an unknown frame, a wrong shape or an angle that is not finite.
        """
        ends = self._frames.number(frame), self._frames.number(relative_to)
        relative = self._frames.relative(self._posture(q), *ends)
        return self._frames.jacobian(*ends, relative)[:, self._frames.column]

    def misplaced(self, frame: str, q: ArrayLike, relative_to: str | None = None) -> Floats:
        """Movement of a frame against another one by errors of the model's joints.

        Args:
            frame: name of the frame, in whose axes the movement is given.
            q: joint angles (n,) [rad].
            relative_to: name of the other frame; None: world.

        Returns:
            Movements (6, n, 6), an offset [m] and a rotation vector [rad], for each joint: by an
            offset of the joint along each axis of its own frame, and by a turn of its axis about
            each, with which the robot stays as it is drawn at the angle 0.

        Raises:
            KinematicsError: an unknown frame, a wrong shape or an angle that is not finite.
        """
        ends = self._frames.number(frame), self._frames.number(relative_to)
        relative = self._frames.relative(self._posture(q), *ends)
        return self._frames.misplaced(*ends, relative)[:, self._frames.column]

    def solve(
        self,
        frame: str,
        pose_target: ArrayLike,
        q_start: ArrayLike,
        relative_to: str | None = None,
        weights: ArrayLike = (1.0,) * 6,
        prior_precision: ArrayLike | None = None,
        free: ArrayLike | None = None,
        options: IkOptions | None = None,
    ) -> IkResult:
        """Find joint angles within their limits that bring a frame to a pose.

        Minimises e' W e + (q - q_start)' L (q - q_start) with e = (offset of the origin [m],
        rotation vector [rad]) from the target, in the target's axes. With W = 1 / variance of a
        measured pose and L = inverse covariance of an estimate this is the likeliest posture.

        Args:
            frame: name of the moving frame.
            pose_target: the pose to reach (4, 4).
            q_start: start of the search (n,) [rad]; clipped into the limits.
            relative_to: name of the frame in which the target is given; None: world.
            weights: diagonal of W (6,); zero for an axis that does not matter.
            prior_precision: L (n,) or (n, n) [1/rad^2]; None: zero.
            free: which joints may move (n,); None: all.
            options: tolerances, iterations and restarts.

        Raises:
            KinematicsError: an unknown frame, a wrong shape, a number that is not finite, or a
                target that is not a rigid pose.
        """
        options = options or IkOptions()
        ends = self._frames.number(frame), self._frames.number(relative_to)
        goal = PoseGoal(self._frames, *ends, pose_target, weights)
        low, high, start = self._box(q_start, free)
        precision, steps = self._precision(prior_precision), options.max_iterations

        def search(begin: Floats) -> IkResult:
            found = minimise(goal, begin, low, high, precision, steps, centre=start)
            return self._judged(found, goal.errors(found.x), options, low, high)

        random = np.random.default_rng(RESTART_SEED)
        best = search(start)
        for _ in range(options.restarts):
            if best.converged:
                break
            other = search(random.uniform(low, high))
            best = min(best, other, key=lambda r: (not r.converged, r.position_error))
        return best

    def point_camera(
        self, camera: str, point: ArrayLike, q_start: ArrayLike, joints: Sequence[str]
    ) -> IkResult:
        """Turn joints within their limits until the axis (z) of a camera points at a point.

        Args:
            camera: name of the camera's frame.
            point: in the world (3,) [m].
            q_start: joint angles (n,) [rad] from which the movement is the least.
            joints: names of the joints that turn.

        Returns:
            The result; its rotation error is the angle between axis and point.

        Raises:
            KinematicsError: as `solve`; or a joint is unknown, or the point lies in the camera.
        """
        goal = PointingGoal(self._frames, self._frames.number(camera), point)
        for joint in joints:
            if joint not in self.joints:
                raise KinematicsError(
                    f"point_camera: unknown joint {joint!r}; joints: {self.joints}."
                )
        low, high, start = self._box(q_start, [name in joints for name in self.joints])
        found = minimise(goal, start, low, high, self._precision(None), POINTING_ITERATIONS)
        angle = float(np.linalg.norm(goal(found.x)[0]))
        reached = angle <= POINTING_TOLERANCE
        reason = self._reason(found, reached, 0.0, angle, low, high)
        return IkResult(found.x, reached, 0.0, angle, found.iterations, reason)

    def unobservable_subspace(
        self,
        frame: str,
        q: ArrayLike,
        relative_to: str | None = None,
        weights: ArrayLike = (1.0,) * 6,
        threshold: float = 1e-6,
    ) -> Floats:
        """Directions of joint space that do not change the pose of a frame.

        These are the singular vectors of sqrt(W) J with singular values below a threshold.

        Args:
            frame: name of the frame.
            q: joint angles (n,) [rad].
            relative_to: name of the frame in which the pose is given; None: world.
            weights: diagonal of W (6,).
            threshold: of the singular values.

        Returns:
            Orthonormal rows (k, n), k >= n - 6; the least observable direction last.

        Raises:
            KinematicsError: an unknown frame, a wrong shape or a number that is not finite.
        """
        root = np.sqrt(finite("weights", weights, (6,)))
        jacobian = root[:, None] * self.frame_jacobian(frame, q, relative_to)
        _, values, vectors = np.linalg.svd(jacobian)
        return vectors[int(np.sum(values >= threshold)) :]

    def _posture(self, q: ArrayLike) -> Floats:
        return finite("q", q, (len(self.joints),))

    def _box(self, q_start: ArrayLike, free: ArrayLike | None) -> tuple[Floats, Floats, Floats]:
        """Lowest, highest and first joint angles (n,) [rad] of a search."""
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
        return finite("prior_precision", matrix, (n, n))

    def _judged(
        self,
        found: Minimum,
        errors: tuple[float, float],
        options: IkOptions,
        low: Floats,
        high: Floats,
    ) -> IkResult:
        metres, angle = errors
        good = metres <= options.position_tolerance and angle <= options.rotation_tolerance
        reason = self._reason(found, good, metres, angle, low, high)
        return IkResult(found.x, good and found.stationary, *errors, found.iterations, reason)

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
