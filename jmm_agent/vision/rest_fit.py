"""Joint angles of all rests, and the posture at which the lengths were zeroed, in one fit.

Lengths count from the posture z at which a person zeroed them. It is not the nominal model's zero
posture, and the largest part of a new robot's error. With the nominal map f, a small error delta of
its shape and e of each length, the robot at rest number k shows

    l_k = f(theta_k) - f(z) + delta(theta_k) + e_k                (lengths)
    0   = log(P_vision,k^-1 P(theta_k))                           (hand, where it was seen)
    0   = G(theta_k)' T_k - tau(theta_k),    G = df/dtheta        (balance)

with the measured tensions T and the torques tau that the nominal model needs to hold a posture:
gravity, and springs of joints. All theta_k and z are found together. delta is integrated out, see
`jmm_agent.vision.observation_fit`; z has a Gaussian prior. Friction takes a share of each muscle's
torque, and a tension sensor has an offset, so the standard deviation of a row of the balance is

    s_j^2 = sum_m (share G_mj T_m)^2 + noise^2.

Its errors have Student's t distribution instead of a Gaussian one, because friction and a joint
that leans on something give rows that are far off. A stop pushes a joint back with a torque that no
muscle shows; a row that is off in that direction counts as balanced.

Kawaharazuka et al. 2018 solve each seen posture alone (sec. III-C) and use no tensions; balance and
zero posture are ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from jmm_agent.errors import AgentError, positive
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.prior import MapPrior
from jmm_agent.types import Floats
from jmm_agent.vision.marker_observation import (
    MarkerObservation,
    ObservationWeights,
    PoseResidual,
    residual_of,
)
from jmm_agent.vision.observation_fit import ObservationFit, ObservationFitOptions, descend
from jmm_agent.vision.prior_widths import Linearised, PriorWidths, likeliest_widths

TELLING = 0.2
"""Mean square of loads and of the torques of tensions, in standard deviations of the balance, below
which both are too small to tell whether they balance [1]."""
DIFFERENCE = 1e-4
"""Change of a joint angle by which the slope of the balance is taken [rad]."""


class Loads(Protocol):
    """Torques that a nominal model needs to hold a posture, such as `kengoro_env`'s nominal arm."""

    def gravity(self, posture: Floats) -> Floats:
        """Torques of gravity and springs on the joints (n,) [N m].

        Args:
            posture: joint angles (n,) [rad].
        """


@dataclass(frozen=True)
class BalanceOptions:
    """How far tensions and loads of a robot at rest may disagree.

    Attributes:
        share: of each muscle's torque, standard deviation: friction and errors of moment arms [1].
        noise: standard deviation of a joint's torque beside that [N m].
        freedom: degrees of freedom of Student's t distribution of the errors.
        stop_margin: a joint this close to its stop may be held by it [rad].
        rests: number of newest rests without an observation that are remembered; 0: none.
        blind: number of such rests from which on the map is corrected before the hand is seen; 0:
            never.

    Raises:
        AgentError: a number is out of range.
    """

    share: float = 0.5
    noise: float = 0.3
    freedom: float = 4.0
    stop_margin: float = 0.03
    rests: int = 10
    blind: int = 5

    def __post_init__(self) -> None:
        positive("BalanceOptions", noise=self.noise, freedom=self.freedom)
        if not 0.0 <= self.share < np.inf:
            raise AgentError(f"BalanceOptions: share is {self.share}, but must be at least 0.")
        if self.rests < 0 or self.blind < 0 or self.blind > self.rests > 0:
            raise AgentError(
                f"BalanceOptions: rests is {self.rests} and blind is {self.blind}, but both must "
                "be at least 0, and blind at most rests."
            )


class Rest(NamedTuple):
    """A robot at rest.

    Attributes:
        lengths: measured (m,) [m].
        tensions: measured (m,) [N].
        guess: estimated joint angles (n,) [rad], where the fit starts.
    """

    lengths: Floats
    tensions: Floats
    guess: Floats


class RestFit(NamedTuple):
    """Result of a fit.

    Attributes:
        observed: joint angles of the K observations, as `fit_observations`.
        rests: joint angles of the other rests (R, n) [rad].
        zero: posture at which the lengths were zeroed (n,) [rad].
        widths: of the map's error, by the lengths at these angles.
        scale: loads over the torques of the tensions, see `Balance.scale`; NaN without a balance.
    """

    observed: ObservationFit
    rests: Floats
    zero: Floats
    widths: PriorWidths
    scale: float


class Balance:
    """Rows of the balance.

    Args:
        jmm: the nominal map.
        loads: of the nominal model.
        limits: lowest and highest angle of each joint (n, 2) [rad].
        options: how far it may be off.
    """

    def __init__(
        self, jmm: JointMuscleMap, loads: Loads, limits: Floats, options: BalanceOptions
    ) -> None:
        self._map, self._loads, self._options = jmm, loads, options
        self._low = limits[:, 0] + options.stop_margin
        self._high = limits[:, 1] - options.stop_margin

    def cost(self, q: Floats, tensions: Floats) -> float:
        """Twice the negative log-likelihood of a rest.

        Args:
            q: joint angles (n,) [rad].
            tensions: measured (m,) [N].
        """
        arms = self._map.jacobian(q)
        tensions = np.maximum(tensions, 0.0)
        missed, variance = self._missed(arms, q, tensions), self._variance(arms, tensions)
        freedom = self._options.freedom
        likelihood = (freedom + 1.0) * np.log1p(missed**2 / (freedom * variance))
        return float(np.sum(likelihood * self._counts(q, missed)))

    def normal_equations(self, q: Floats, tensions: Floats) -> tuple[Floats, Floats]:
        """Gauss-Newton matrix (n, n) and gradient (n,) of a rest, half those of `cost`.

        Args:
            q: joint angles (n,) [rad].
            tensions: measured (m,) [N].
        """
        moves, tensions = DIFFERENCE * np.eye(len(q)), np.maximum(tensions, 0.0)
        points = np.vstack([q + moves, q - moves, q[None]])
        arms = self._map.jacobian(points)
        missed = np.array(
            [self._missed(arm, point, tensions) for arm, point in zip(arms, points, strict=True)]
        )
        count, freedom = len(q), self._options.freedom
        slope = (missed[:count] - missed[count:-1]).T / (2.0 * DIFFERENCE)
        here, variance = missed[-1], self._variance(arms[-1], tensions)
        weight = (freedom + 1.0) / (freedom * variance + here**2)
        weight = weight * self._counts(q, here)
        return (slope.T * weight) @ slope, slope.T @ (weight * here)

    def scale(self, angles: Floats, tensions: Sequence[Floats | None]) -> float:
        """Loads over the torques of the tensions, by least squares over all rests [1].

        It is 1 but for noise if tensions and loads are in the units and signs of the model. It is
        NaN where both are too small to tell.

        Args:
            angles: joint angles (K, n) [rad].
            tensions: measured (m,) [N], of each; None: unknown.
        """
        shared = own = loads = 0.0
        rows = 0
        for q, measured in zip(angles, tensions, strict=True):
            if measured is None:
                continue
            pulled, arms = np.maximum(measured, 0.0), self._map.jacobian(q)
            torques, load = pulled @ arms, self._loads.gravity(q)
            weight = 1.0 / self._variance(arms, pulled)
            shared += float(np.sum(weight * torques * load))
            own += float(np.sum(weight * torques**2))
            loads += float(np.sum(weight * load**2))
            rows += len(q)
        if loads == 0.0 or max(loads, own) <= TELLING * rows:
            return np.nan
        return shared / own if own > 0.0 else 0.0

    def _missed(self, arms: Floats, q: Floats, tensions: Floats) -> Floats:
        return tensions @ arms - self._loads.gravity(q)

    def _variance(self, arms: Floats, tensions: Floats) -> Floats:
        share, noise = self._options.share, self._options.noise
        return np.asarray(np.sum((share * arms * tensions[:, None]) ** 2, axis=0) + noise**2)

    def _counts(self, q: Floats, missed: Floats) -> Floats:
        """0 for a joint at a stop that pushes with the missing torque (n,) [N m], else 1 (n,)."""
        held = (q <= self._low) & (missed > 0.0) | (q >= self._high) & (missed < 0.0)
        return np.asarray(~held, dtype=float)


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

    Attributes:
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
    ) -> None:
        self._observations, self._marker_residual = observations, marker_residual
        self._balance, self.widths = balance, widths
        self._prior = prior.zeroed(np.zeros(len(prior.map.joints)), widths.offset, widths.shape)
        lengths = [found.lengths for found in observations] + [rest.lengths for rest in rests]
        self._lengths = np.array(lengths)
        tensions = [found.tensions for found in observations] + [rest.tensions for rest in rests]
        self._tensions = [
            one if one is not None and np.isfinite(one).all() else None for one in tensions
        ]
        none = np.zeros((len(rests), elongated.shape[1]))
        self._elongated = np.vstack([elongated, none])
        self.weights = ObservationWeights(
            observations, options.position_noise, options.rotation_noise, options.joint_noise
        )

    def likeliest_widths(self, unknown: Floats, usual: PriorWidths) -> PriorWidths:
        """Widths that make the lengths likelier.

        Args:
            unknown: angles (K + R + 1, n) [rad].
            usual: widths before anything was measured.
        """
        missed, arms = self._missed_and_arms(unknown)
        kernels = self._prior.groups(unknown[:-1], elongated=self._elongated)
        matrix = self.normal_equations(unknown)[0]
        rows = self._rows(len(missed))
        fit = Linearised(matrix, rows, arms, missed, kernels, unknown[-1])
        return likeliest_widths(fit, self.widths, usual)

    def scale(self, unknown: Floats) -> float:
        """Loads over the torques of the tensions; see `Balance.scale`."""
        if self._balance is None:
            return np.nan
        return self._balance.scale(unknown[:-1], self._tensions)

    def cost(self, unknown: Floats) -> tuple[float, Floats]:
        """Cost at angles (K + R + 1, n) [rad], and the marker's residuals (K, 6) [m, rad]."""
        angles, zero = unknown[:-1], unknown[-1]
        pairs = zip(self._observations, angles, strict=False)
        residuals = [residual_of(f, self._marker_residual, q)[0] for f, q in pairs]
        poses = np.array(residuals).reshape(-1, 6)
        lengths = self._prior.map.lengths(unknown)
        missed = self._lengths - lengths[:-1] + lengths[-1]
        cost = self.weights.cost(angles[: len(poses)], poses)
        cost += float(np.sum(zero**2)) / self.widths.zero**2
        for group in self._prior.groups(angles, elongated=self._elongated):
            own = missed[:, group.muscles]
            cost += float(np.sum(own * group.whiten(own)))
        if self._balance is not None:
            for q, tensions in zip(angles, self._tensions, strict=True):
                cost += 0.0 if tensions is None else self._balance.cost(q, tensions)
        return cost, poses

    def normal_equations(self, unknown: Floats) -> tuple[Floats, Floats]:
        """Gauss-Newton matrix and gradient at angles (K + R + 1, n) [rad], half those of the cost.

        The kernel is held fixed.
        """
        count, joints = len(unknown) - 1, unknown.shape[1]
        matrix = np.zeros((count + 1, joints, count + 1, joints))
        gradient = np.zeros((count + 1, joints))
        for k, q in enumerate(unknown[:-1]):
            for own, pull in self._of_rest(k, q):
                matrix[k, :, k, :] += own
                gradient[k] += pull
        matrix[-1, :, -1, :] += np.eye(joints) / self.widths.zero**2
        gradient[-1] += unknown[-1] / self.widths.zero**2
        missed, jacobian = self._missed_and_arms(unknown)
        rows = self._rows(count)
        for group in self._prior.groups(unknown[:-1], elongated=self._elongated):
            arms, white = jacobian[:, group.muscles], group.whiten(missed[:, group.muscles])
            information = rows.T @ group.whiten(rows)
            products = np.einsum("kmi,lmj->kilj", arms, arms, optimize=True)
            matrix += information[:, None, :, None] * products
            gradient -= np.einsum("kmi,km->ki", arms, rows.T @ white)
        size = (count + 1) * joints
        return matrix.reshape(size, size), gradient.ravel()

    def _missed_and_arms(self, unknown: Floats) -> tuple[Floats, Floats]:
        """Lengths minus those of the nominal map, and how each unknown posture moves the latter."""
        lengths, jacobian = self._prior.map.lengths_and_jacobian(unknown)
        jacobian[-1] *= -1.0
        return self._lengths - lengths[:-1] + lengths[-1], jacobian

    @staticmethod
    def _rows(count: int) -> Floats:
        """Which length each unknown posture moves: its own, or all (count, count + 1)."""
        return np.column_stack([np.eye(count), np.ones(count)])

    def _of_rest(self, k: int, q: Floats) -> list[tuple[Floats, Floats]]:
        """Normal equations of the hand and of the balance of a rest at angles (n,) [rad]."""
        found, tensions = [], self._tensions[k]
        if k < len(self._observations):
            seen = residual_of(self._observations[k], self._marker_residual, q)
            found.append(self.weights.normal_equations(k, q, *seen))
        if self._balance is not None and tensions is not None:
            found.append(self._balance.normal_equations(q, tensions))
        return found


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
    return RestFit(seen, end.angles[observed:-1], end.angles[-1], widths, scale)
