"""Joint angles of all rests, and the posture at which the lengths were zeroed, in one fit.

Lengths count from the posture z at which a person zeroed them. It is not the nominal model's zero
posture, and the largest part of a new robot's error. With the nominal map f, a small error delta of
its shape and e of each length, the robot at rest number k shows

    l_k = f(theta_k) - f(z) + delta(theta_k) + e_k                (lengths)
    0   = log(P_vision,k^-1 P(theta_k))                           (hand, where it was seen)
    0   = G(theta_k)' T_k - tau(theta_k),    G = df/dtheta        (balance)

with the measured tensions T and the torques tau that the nominal model needs to hold a posture:
gravity, and springs of joints. All theta_k and z are found together. delta is integrated out, see
`jmm_agent.vision.observation_fit`; z has a Gaussian prior. The errors of the balance are those of
`jmm_agent.vision.balance`.

Kawaharazuka et al. 2018 solve each seen posture alone (sec. III-C) and use no tensions; balance and
zero posture are ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve

from jmm_agent.mapping.prior import GroupKernel, MapPrior, without_unknown
from jmm_agent.types import Floats
from jmm_agent.vision.balance import Balance
from jmm_agent.vision.camera_unknowns import CameraPrior, camera_of, corrected_observations
from jmm_agent.vision.marker_observation import (
    MarkerObservation,
    ObservationWeights,
    PoseResidual,
    residual_of,
)
from jmm_agent.vision.observation_fit import ObservationFit, ObservationFitOptions, descend
from jmm_agent.vision.pose_errors import JointPrior, PoseErrors, joint_columns
from jmm_agent.vision.prior_widths import Linearised, PriorWidths, likeliest_widths


class Rest(NamedTuple):
    """A robot at rest.

    Attributes:
        lengths: measured (m,) [m]; NaN of muscles that were out of use.
        tensions: measured (m,) [N].
        guess: estimated joint angles (n,) [rad], where the fit starts.
    """

    lengths: Floats
    tensions: Floats
    guess: Floats


class CommonErrors(NamedTuple):
    """Errors that all observed poses share, as they are believed when a fit begins.

    Attributes:
        prior: standard deviations of the camera's errors.
        joints: standard deviations of the joints' errors.
        camera: errors of the camera (8,) [m, rad, 1, 1].
        angles: about the joint angles of the observations (K, n) [rad].
    """

    prior: CameraPrior
    joints: JointPrior
    camera: Floats
    angles: Floats


class RestFit(NamedTuple):
    """Result of a fit.

    Attributes:
        observed: joint angles of the K observations, as `fit_observations`.
        rests: joint angles of the other rests (R, n) [rad].
        zero: posture at which the lengths were zeroed (n,) [rad].
        widths: of the map's error, by the lengths at these angles.
        scale: loads over the torques of the tensions, see `Balance.scale`; NaN without a balance.
        camera: errors of the camera (8,) [m, rad, 1, 1], see `camera_unknowns`; None: none is
            believed.
    """

    observed: ObservationFit
    rests: Floats
    zero: Floats
    widths: PriorWidths
    scale: float
    camera: Floats | None = None

    @property
    def unknown(self) -> Floats:
        """All angles that were fitted (K + R + 1, n) [rad], as `RestProblem` takes them."""
        return np.vstack([self.observed.angles, self.rests, self.zero])


class RestProblem:
    """Cost of the joint angles of all rests and of the zero posture (K + R + 1, n) [rad].

    The rows are those of the K observations, of the R other rests, and the zero posture.

    Args:
        observations: K observations.
        rests: R rests without an observation.
        prior: prior of the map's error.
        widths: of that error, once the zero posture is known.
        marker_residual: residual of the marker's pose at a posture.
        balance: of tensions and loads; None: unknown loads.
        options: noise levels.
        elongated: number of permanent elongations of each muscle since each observation (K, m).
        common: standard deviations of errors that all observations share; None: there are none.

    Attributes:
        prior: prior of the map's error with these widths, once the zero posture is known.
        widths: as given.
        weights: weights of the measured poses and joint angles.
    """

    def __init__(
        self,
        observations: Sequence[MarkerObservation],
        rests: Sequence[Rest],
        prior: MapPrior,
        widths: PriorWidths,
        marker_residual: PoseResidual,
        balance: Balance | None,
        options: ObservationFitOptions,
        elongated: Floats,
        common: CommonErrors | None = None,
    ) -> None:
        self._marker_residual = marker_residual
        self._balance, self.widths = balance, widths
        zero = np.zeros(len(prior.map.joints))
        self.prior = prior.zeroed(zero, widths.offset, widths.shape, widths.points)
        lengths = [found.lengths for found in observations] + [rest.lengths for rest in rests]
        tensions = [found.tensions for found in observations] + [rest.tensions for rest in rests]
        whole = [one is not None and bool(np.isfinite(one).all()) for one in tensions]
        self._balanced = np.flatnonzero(whole) if balance is not None else np.arange(0)
        self._tensions = np.array([tensions[k] for k in self._balanced])
        none = np.zeros((len(rests), elongated.shape[1]))
        self._lengths, self._elongated = without_unknown(
            np.array(lengths).reshape(-1, elongated.shape[1]), np.vstack([elongated, none])
        )
        self.weights = ObservationWeights(
            observations, options.position_noise, options.rotation_noise, options.joint_noise
        )
        self._newest: tuple[Floats, Sequence[GroupKernel]] | None = None
        self._common, self._observations = None, list(observations)
        if common is not None and len(observations):
            joints = joint_columns(observations, common.angles, marker_residual, common.joints)
            frame = camera_of(marker_residual)
            self._common = PoseErrors(
                observations, common.prior, common.camera, joints, self.weights, frame
            )
            self._observations = corrected_observations(observations, common.camera, frame)

    def camera(self, unknown: Floats) -> Floats | None:
        """Most probable errors of the camera (8,) at angles (K + R + 1, n) [rad]."""
        return None if self._common is None else self._common.camera(self._poses(unknown))

    def _poses(self, unknown: Floats) -> Floats:
        """Residuals (K, 6) [m, rad] of the poses as the camera is believed to show them."""
        pairs = zip(self._observations, unknown, strict=False)
        residuals = [residual_of(f, self._marker_residual, q)[0] for f, q in pairs]
        return np.array(residuals).reshape(-1, 6)

    def likeliest_widths(self, unknown: Floats, usual: PriorWidths) -> PriorWidths:
        """Widths that make the lengths likelier.

        Args:
            unknown: angles (K + R + 1, n) [rad].
            usual: widths before anything was measured.
        """
        return likeliest_widths(self.linearised(unknown), self.widths, usual)

    def linearised(self, unknown: Floats) -> Linearised:
        """The problem about angles (K + R + 1, n) [rad]."""
        missed, arms = self._missed_and_arms(unknown)
        kernels = self._kernels(unknown[:-1])
        matrix = self.normal_equations(unknown)[0]
        return Linearised(matrix, self._rows(len(missed)), arms, missed, kernels, unknown[-1])

    def log_evidence(self, unknown: Floats, near: bool = False) -> float:
        """Logarithm of the probability of all that was measured with these widths.

        It lacks a constant that is the same for all widths. Joint angles and zero posture are
        integrated out about ``unknown`` (Laplace's method).

        Args:
            unknown: most probable angles (K + R + 1, n) [rad].
            near: whether they are only near the most probable ones, of another problem that is
                nearly the same.
        """
        kernels = self._kernels(unknown[:-1])
        spread = sum(len(kernel.muscles) * kernel.log_det for kernel in kernels)
        spread += 2.0 * unknown.shape[1] * np.log(self.widths.zero)
        spread += 0.0 if self._common is None else self._common.log_det
        matrix, gradient = self.normal_equations(unknown)
        spread += float(np.linalg.slogdet(matrix)[1])
        gain = float(gradient @ solve(matrix, gradient, assume_a="pos")) if near else 0.0
        return -0.5 * (self.cost(unknown)[0] - gain + spread)

    def scale(self, unknown: Floats) -> float:
        """Loads over the torques of the tensions; see `Balance.scale`."""
        if self._balance is None:
            return np.nan
        return self._balance.scale(unknown[self._balanced], self._tensions)

    def cost(self, unknown: Floats) -> tuple[float, Floats]:
        """Cost at angles (K + R + 1, n) [rad], and the marker's residuals (K, 6) [m, rad]."""
        angles, zero = unknown[:-1], unknown[-1]
        poses, cost = self._poses(angles), 0.0
        if self._common is not None:
            poses, cost = self._common.remaining(poses)
        lengths = self.prior.map.lengths(unknown)
        missed = self._lengths - lengths[:-1] + lengths[-1]
        cost += self.weights.cost(angles[: len(poses)], poses)
        cost += float(np.sum(zero**2)) / self.widths.zero**2
        for group in self._kernels(angles):
            own = missed[:, group.muscles]
            cost += float(np.sum(own * group.whiten(own)))
        if self._balance is not None and len(self._balanced):
            cost += self._balance.cost(angles[self._balanced], self._tensions)
        return cost, poses

    def normal_equations(self, unknown: Floats) -> tuple[Floats, Floats]:
        """Gauss-Newton matrix and gradient at angles (K + R + 1, n) [rad], half those of the cost.

        The kernel is held fixed.
        """
        count, joints = len(unknown) - 1, unknown.shape[1]
        matrix = np.zeros((count + 1, joints, count + 1, joints))
        gradient = np.zeros((count + 1, joints))
        self._add_poses(unknown, matrix, gradient)
        if self._balance is not None and len(self._balanced):
            known, each = self._balanced, np.arange(joints)
            own, pull = self._balance.normal_equations(unknown[known], self._tensions)
            matrix[np.ix_(known, each, known, each)] += own
            gradient[known] += pull
        matrix[-1, :, -1, :] += np.eye(joints) / self.widths.zero**2
        gradient[-1] += unknown[-1] / self.widths.zero**2
        missed, jacobian = self._missed_and_arms(unknown)
        rows = self._rows(count)
        shared = np.zeros((count + 1, count + 1, jacobian.shape[1]))
        for group in self._kernels(unknown[:-1]):
            arms, white = jacobian[:, group.muscles], group.whiten(missed[:, group.muscles])
            shared[:, :, group.muscles] = (rows.T @ group.whiten(rows))[:, :, None]
            gradient -= np.einsum("kmi,km->ki", arms, rows.T @ white)
        turned = jacobian.transpose(0, 2, 1)[:, None] * shared[:, :, None, :]
        matrix += (turned @ jacobian).transpose(0, 2, 1, 3)
        size = (count + 1) * joints
        return matrix.reshape(size, size), gradient.ravel()

    def _add_poses(self, unknown: Floats, matrix: Floats, gradient: Floats) -> None:
        """Add what the observed poses tell to the matrix and the gradient of all postures."""
        count = len(self._observations)
        pairs = zip(self._observations, unknown, strict=False)
        seen = [residual_of(found, self._marker_residual, q) for found, q in pairs]
        poses = np.array([residual for residual, _ in seen]).reshape(-1, 6)
        if self._common is not None:
            poses = self._common.remaining(poses)[0]
            shape = (count, unknown.shape[1]) * 2
            taken = self._common.taken([slope for _, slope in seen])
            matrix[:count, :, :count, :] -= taken.reshape(shape)
        for k, (residual, (_, slope)) in enumerate(zip(poses, seen, strict=True)):
            own, pull = self.weights.normal_equations(k, unknown[k], residual, slope)
            matrix[k, :, k, :] += own
            gradient[k] += pull

    def _kernels(self, angles: Floats) -> Sequence[GroupKernel]:
        """Kernels at angles (K + R, n) [rad]; those of the newest angles are kept."""
        if self._newest is None or not np.array_equal(self._newest[0], angles):
            self._newest = angles.copy(), self.prior.groups(angles, elongated=self._elongated)
        return self._newest[1]

    def _missed_and_arms(self, unknown: Floats) -> tuple[Floats, Floats]:
        """Lengths minus those of the nominal map, and how each unknown posture moves the latter."""
        lengths, jacobian = self.prior.map.lengths_and_jacobian(unknown)
        jacobian[-1] *= -1.0
        return self._lengths - lengths[:-1] + lengths[-1], jacobian

    @staticmethod
    def _rows(count: int) -> Floats:
        """Which length each unknown posture moves: its own, or all (count, count + 1)."""
        return np.column_stack([np.eye(count), np.ones(count)])


def fit_rests(
    problem: RestProblem,
    start: Floats,
    limits: Floats,
    options: ObservationFitOptions,
    observed: int,
    usual: PriorWidths | None,
) -> RestFit:
    """Fit the joint angles of all rests and the zero posture (module docstring).

    Args:
        problem: the cost.
        start: angles of K observations, R rests and the zero posture (K + R + 1, n) [rad].
        limits: lowest and highest angle of each joint (n, 2) [rad]; the zero posture may be beyond.
        options: limits of the fit.
        observed: number of observations, K.
        usual: widths of the map's error before anything was measured; None to keep the present
            ones.
    """
    low = np.broadcast_to(limits[:, 0] - options.limit_margin, start.shape).copy()
    high = np.broadcast_to(limits[:, 1] + options.limit_margin, start.shape).copy()
    low[-1], high[-1] = -np.inf, np.inf
    end, converged = descend(problem, np.clip(start, low, high), low, high, options)
    norms = problem.weights.norms(end.residuals)
    seen = ObservationFit(end.angles[:observed], converged, norms)
    widths = problem.widths if usual is None else problem.likeliest_widths(end.angles, usual)
    scale = problem.scale(end.angles)
    camera = problem.camera(end.angles)
    return RestFit(seen, end.angles[observed:-1], end.angles[-1], widths, scale, camera)
