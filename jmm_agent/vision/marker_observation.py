"""Marker observations: what was measured at a settled posture, and its weight in a fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from scipy.stats import chi2

from jmm_agent.types import Floats
from jmm_agent.vision.pose_covariance import UNKNOWN, pose_weight

Frames = tuple[str, str | None]
"""Names of a frame and of the frame in which its pose is given; None: world."""


CONTRADICTION = 6.0
"""Standard deviations by which a joint encoder may be missed by the fit of an observation."""
UNCERTAIN = 4.0
"""A pose is uncertain if all that it measures has standard deviations from this multiple of the
options' noise on [1]."""
AGREEMENT = 0.999
"""Share of uncertain poses that agree with the true posture [1]."""


class MarkerObservation(NamedTuple):
    """One settled posture in which the marker was seen, or the hand's pose measured otherwise.

    Attributes:
        pose: measured pose_marker_in_camera (4, 4), or the pose of ``frames``.
        lengths: measured muscle lengths (m,) [m]; NaN of muscles that were out of use.
        guess: estimated joint angles (n,) [rad], where the fit starts.
        frames: whose pose it is, and in which frame; None: the marker's in the camera.
        covariance: of the pose (6, 6), see `checked_covariance`; None: the noise of the options.
        joint_angles: measured joint angles (n,) [rad], NaN where there is no encoder; None: none.
        tensions: measured (m,) [N]; None: unknown.
    """

    pose: Floats
    lengths: Floats
    guess: Floats
    frames: Frames | None = None
    covariance: Floats | None = None
    joint_angles: Floats | None = None
    tensions: Floats | None = None


class PoseResidual(Protocol):
    """Residual of a posture against a measured pose."""

    def __call__(
        self, q: Floats, pose: Floats, frames: Frames | None = None, /
    ) -> tuple[Floats, Floats]:
        """Residual (6,) [m, rad] and its Jacobian (6, n).

        Args:
            q: joint angles (n,) [rad].
            pose: measured pose (4, 4).
            frames: whose pose it is, and in which frame; None: the marker's in the camera.
        """


def residual_of(
    found: MarkerObservation, marker_residual: PoseResidual, q: Floats
) -> tuple[Floats, Floats]:
    """Residual (6,) [m, rad] of a posture (n,) [rad] against an observation, and its Jacobian."""
    if found.frames is None:
        return marker_residual(q, found.pose)
    return marker_residual(q, found.pose, found.frames)


def contradicted_joint(found: MarkerObservation, angles: Floats, joint_noise: float) -> int | None:
    """Number of the joint whose encoder is missed by most, if by more than noise; else None.

    Args:
        found: the observation.
        angles: joint angles (n,) [rad] that were fitted to it.
        joint_noise: standard deviation of a measured joint angle [rad].
    """
    if found.joint_angles is None:
        return None
    missed = np.nan_to_num(np.abs(found.joint_angles - angles), nan=0.0)
    worst = int(missed.argmax())
    return worst if missed[worst] > CONTRADICTION * joint_noise else None


def adds_only_noise(
    found: MarkerObservation,
    marker_residual: PoseResidual,
    position_noise: float,
    rotation_noise: float,
) -> bool:
    """Whether an uncertain pose agrees with the estimate, so that only its noise can be learned.

    The accuracy of the estimate is unknown; it is only known that the pose does not contradict it.
    With joint encoders an observation also holds measured angles, so it is kept.

    Args:
        found: the observation.
        marker_residual: residual of the marker's pose at a posture.
        position_noise: standard deviation of what the kinematics miss [m].
        rotation_noise: standard deviation of what the kinematics miss [rad].
    """
    if found.covariance is None or found.joint_angles is not None:
        return False
    variances = np.diag(found.covariance)
    measured = variances < UNKNOWN
    least = UNCERTAIN**2 * np.repeat([position_noise**2, rotation_noise**2], 3)
    if np.any(variances[measured] < least[measured]):
        return False
    missed = residual_of(found, marker_residual, found.guess)[0]
    weight = pose_weight(found.covariance, found.pose, position_noise, rotation_noise)
    return bool(missed @ weight @ missed <= chi2.ppf(AGREEMENT, measured.sum()))


def usual_noise(
    observations: Sequence[MarkerObservation], position_noise: float, rotation_noise: float
) -> tuple[float, float]:
    """Usual standard deviations of a position [m] and a rotation [rad], by poses so far.

    Args:
        observations: K observations; those without a covariance have the noise of the options.
        position_noise: of the options [m].
        rotation_noise: of the options [rad].
    """
    found = []
    for one in observations:
        variances = np.zeros(6) if one.covariance is None else np.diag(one.covariance)
        means = (float(np.mean(variances[:3])), float(np.mean(variances[3:])))
        if max(means) < UNKNOWN / 3.0:
            found.append(means)
    more = np.median(found, axis=0) if found else np.zeros(2)
    noise = np.sqrt(np.array([position_noise**2, rotation_noise**2]) + more)
    return float(noise[0]), float(noise[1])


class ObservationWeights:
    """Weights of the measurements of K observations, but for the muscle lengths.

    Args:
        observations: K observations.
        position_noise: standard deviation of a pose without covariance, and of what the kinematics
            miss of one with it [m].
        rotation_noise: the same of its rotation [rad].
        joint_noise: standard deviation of a measured joint angle [rad].
    """

    def __init__(
        self,
        observations: Sequence[MarkerObservation],
        position_noise: float,
        rotation_noise: float,
        joint_noise: float,
    ) -> None:
        plain = np.repeat([position_noise**-2, rotation_noise**-2], 3)
        self._units = position_noise, rotation_noise
        self._root = np.repeat([1.0 / position_noise, 1.0 / rotation_noise], 3)
        self._plain = np.tile(plain, (len(observations), 1))
        self._full: dict[int, Floats] = {}
        self._joints: dict[int, tuple[Floats, Floats]] = {}
        for k, found in enumerate(observations):
            if found.covariance is not None:
                self._plain[k] = 0.0
                self._full[k] = pose_weight(
                    found.covariance, found.pose, position_noise, rotation_noise
                )
            if found.joint_angles is not None:
                measured = np.isfinite(found.joint_angles)
                weight = np.where(measured, joint_noise**-2, 0.0)
                self._joints[k] = weight, np.where(measured, found.joint_angles, 0.0)

    def cost(self, angles: Floats, residuals: Floats) -> float:
        """Cost of joint angles (K, n) [rad] with residuals (K, 6) [m, rad]."""
        cost = float(np.sum(self._plain * residuals**2))
        for k, weight in self._full.items():
            cost += float(residuals[k] @ weight @ residuals[k])
        for k, (weight, measured) in self._joints.items():
            cost += float(np.sum(weight * (angles[k] - measured) ** 2))
        return cost

    def matrix(self, k: int) -> Floats:
        """Weight (6, 6) of the pose of an observation."""
        return self._full[k] if k in self._full else np.diag(self._plain[k])

    def normal_equations(
        self, k: int, q: Floats, residual: Floats, slope: Floats
    ) -> tuple[Floats, Floats]:
        """Gauss-Newton matrix (n, n) and gradient (n,) of an observation; half those of the cost.

        Args:
            k: number of the observation.
            q: its joint angles (n,) [rad].
            residual: (6,) [m, rad].
            slope: Jacobian of the residual (6, n).
        """
        if k in self._full:
            weighted, pull = self._full[k] @ slope, self._full[k] @ residual
        else:
            weighted, pull = self._plain[k][:, None] * slope, self._plain[k] * residual
        matrix, gradient = slope.T @ weighted, slope.T @ pull
        if k in self._joints:
            weight, measured = self._joints[k]
            matrix = matrix + np.diag(weight)
            gradient = gradient + weight * (q - measured)
        return matrix, gradient

    def whitened(self, k: int, q: Floats, residual: Floats, slope: Floats) -> tuple[Floats, Floats]:
        """Residuals of an observation in standard deviations, and their Jacobian.

        Args:
            k: number of the observation.
            q: its joint angles (n,) [rad].
            residual: (6,) [m, rad].
            slope: Jacobian of the residual (6, n).
        """
        if k in self._full:
            values, axes = np.linalg.eigh(self._full[k])
            root = np.sqrt(np.maximum(values, 0.0))[:, None] * axes.T
            residual, slope = root @ residual, root @ slope
        else:
            residual, slope = self._root * residual, self._root[:, None] * slope
        if k in self._joints:
            weight, measured = self._joints[k]
            rows = np.flatnonzero(weight)
            own = np.sqrt(weight[rows])
            residual = np.append(residual, own * (q - measured)[rows])
            slope = np.vstack([slope, own[:, None] * np.eye(len(q))[rows]])
        return residual, slope

    def norms(self, residuals: Floats) -> Floats:
        """Distance [m] and angle [rad] (K, 2) by which the observations are missed.

        For a pose with a covariance, those of a marker that is missed by as many standard
        deviations of the options' noise.
        """
        position, rotation = residuals[:, :3], residuals[:, 3:]
        norms = np.column_stack(
            [np.linalg.norm(position, axis=1), np.linalg.norm(rotation, axis=1)]
        )
        for k, weight in self._full.items():
            for block, unit in enumerate(self._units):
                rows = slice(3 * block, 3 * block + 3)
                missed = residuals[k, rows] @ weight[rows, rows] @ residuals[k, rows]
                norms[k, block] = unit * np.sqrt(max(float(missed), 0.0))
        return norms
