"""Joint angles of many marker observations, fitted together with the muscle lengths.

One marker observation has six numbers and the arm fourteen joints, so inverse kinematics from one
observation leaves errors in the joint angles that the marker does not show. But the error of the
muscle lengths is not independent from posture to posture: lengths that were zeroed at a wrong
posture, or a point of attachment that lies elsewhere, make it a smooth function of the joint
angles, the same in all observations. Write the measured lengths of observation k as

    l_k = f(theta_k) + delta(theta_k) + e_k

with the nominal model's map f, and let delta be a Gaussian process whose kernel is that of the
output layer's prior (`MapPrior`). Then all joint angles theta_1..theta_K are found at once, with
delta integrated out:

    min  sum_k |log(P_vision,k^-1 P(theta_k))|^2_V  +  sum_m r_m' (Phi Phi' + s^2 I)^-1 r_m,
    r_m = (l_km - f_m(theta_k))_k,

by damped Gauss-Newton steps inside the joint limits. Joints that the gradient pushes against a
limit are held there while the others move.

Kawaharazuka et al. 2018 (sec. III-C) solve each observation alone, with the least movement from
the estimate; `fit_alone` does this.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from jmm_agent.kinematics.bounded_least_squares import minimise
from jmm_agent.mapping.prior import MapPrior, without_unknown
from jmm_agent.types import Floats
from jmm_agent.vision.marker_observation import (
    MarkerObservation,
    ObservationWeights,
    PoseResidual,
    residual_of,
)

__all__ = [
    "FitPoint",
    "MarkerObservation",
    "ObservationFit",
    "ObservationFitOptions",
    "ObservationProblem",
    "PoseResidual",
    "descend",
    "fit_alone",
    "fit_observations",
]

ALONE_STEPS = 100
"""Largest number of Gauss-Newton steps for one observation alone."""

START_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-6, 1e6
"""Damping relative to the diagonal of the Gauss-Newton matrix."""

LARGEST_STEP = 0.3
"""Largest change of a joint angle in one step [rad]."""


@dataclass(frozen=True)
class ObservationFitOptions:
    """Noise levels and limits of the fit.

    Attributes:
        position_noise: standard deviation of the marker's position in the camera frame [m].
        rotation_noise: standard deviation of the marker's orientation [rad].
        joint_noise: standard deviation of a joint angle by its encoder, with its zero [rad].
        steps: largest number of Gauss-Newton steps.
        tolerance: a step smaller than this ends the fit [rad].
        gain: a step that lowers the cost by less than this ends the fit; the cost is twice a
            negative log-likelihood.
        limit_margin: how far outside its limits a joint angle may be [rad].
        memory: number of newest observations that are remembered.
        least_movement: pull towards the estimate when an observation is solved alone [1/rad^2].
        elongation_evidence: least logarithm of the Bayes factor from which on a permanent
            elongation is believed; infinite to believe in none.
        elongation_recent: number of newest observations among which one is looked for.
    """

    position_noise: float = 0.003
    rotation_noise: float = 0.01
    joint_noise: float = 0.005
    steps: int = 30
    tolerance: float = 1e-4
    gain: float = 0.01
    limit_margin: float = 0.02
    memory: int = 60
    least_movement: float = 0.1
    elongation_evidence: float = 4.0
    elongation_recent: int = 5


class ObservationFit(NamedTuple):
    """Result of a fit.

    Attributes:
        angles: joint angles of all K observations (K, n) [rad].
        converged: whether the fit ended in a minimum.
        residual_norms: remaining distance [m] and angle [rad] of the marker in each observation
            (K, 2), see `ObservationWeights.norms`.
    """

    angles: Floats
    converged: bool
    residual_norms: Floats


def fit_observations(
    observations: Sequence[MarkerObservation],
    prior: MapPrior,
    marker_residual: PoseResidual,
    limits: Floats,
    options: ObservationFitOptions,
    start: Floats | None = None,
    elongated: Floats | None = None,
) -> ObservationFit:
    """Fit the joint angles of all observations at once (module docstring).

    Args:
        observations: K observations.
        prior: prior of the map's error.
        marker_residual: residual of the marker's pose at a posture.
        limits: lowest and highest angle of each joint (n, 2) [rad].
        options: noise levels and limits of the fit.
        start: angles (K, n) [rad] to start from; the observations' guesses if left out.
        elongated: number of permanent elongations of each muscle since each observation (K, m);
            none if left out.
    """
    low, high = limits[:, 0] - options.limit_margin, limits[:, 1] + options.limit_margin
    guesses = np.array([found.guess for found in observations]) if start is None else start
    problem = ObservationProblem(observations, prior, marker_residual, options, elongated)
    end, converged = descend(problem, np.clip(guesses, low, high), low, high, options)
    return ObservationFit(end.angles, converged, problem.weights.norms(end.residuals))


def fit_alone(
    observation: MarkerObservation,
    marker_residual: PoseResidual,
    limits: Floats,
    options: ObservationFitOptions,
) -> ObservationFit:
    """Fit the joint angles of one observation, as near as possible to its guess (sec. III-C).

    Args:
        observation: the observation; its lengths are not used.
        marker_residual: residual of the marker's pose at a posture.
        limits: lowest and highest angle of each joint (n, 2) [rad].
        options: noise levels and limits of the fit.
    """
    low, high = limits[:, 0] - options.limit_margin, limits[:, 1] + options.limit_margin
    weights = ObservationWeights(
        [observation], options.position_noise, options.rotation_noise, options.joint_noise
    )

    def residual(q: Floats) -> tuple[Floats, Floats]:
        return weights.whitened(0, q, *residual_of(observation, marker_residual, q))

    start = np.clip(observation.guess, low, high)
    pull = options.least_movement * np.eye(len(start))
    found = minimise(residual, start, low, high, pull, ALONE_STEPS)
    error = residual_of(observation, marker_residual, found.x)[0]
    return ObservationFit(found.x[None], found.stationary, weights.norms(error[None]))


class FitProblem(Protocol):
    """Cost of joint angles (K, n) [rad]."""

    def cost(self, angles: Floats) -> tuple[float, Floats]:
        """Cost at angles (K, n) [rad], and residuals of the poses (K, 6) [m, rad]."""

    def normal_equations(self, angles: Floats) -> tuple[Floats, Floats]:
        """Gauss-Newton matrix (K n, K n) and gradient (K n,), half those of the cost."""


class ObservationProblem:
    """Cost that `fit_observations` minimises, as a function of joint angles (K, n) [rad].

    Args:
        observations: K observations.
        prior: prior of the map's error.
        marker_residual: residual of the marker's pose at a posture.
        options: noise levels.
        elongated: number of permanent elongations of each muscle since each observation (K, m);
            none if left out.

    Attributes:
        weights: weights of the measured poses and joint angles.
    """

    def __init__(
        self,
        observations: Sequence[MarkerObservation],
        prior: MapPrior,
        marker_residual: PoseResidual,
        options: ObservationFitOptions,
        elongated: Floats | None = None,
    ) -> None:
        self._observations, self._prior = observations, prior
        self._marker_residual = marker_residual
        lengths = np.array([found.lengths for found in observations])
        self._lengths, self._elongated = without_unknown(lengths, elongated)
        self.weights = ObservationWeights(
            observations, options.position_noise, options.rotation_noise, options.joint_noise
        )

    def cost(self, angles: Floats) -> tuple[float, Floats]:
        """Cost at angles (K, n) [rad], and the marker's residuals (K, 6) [m, rad]."""
        pairs = zip(self._observations, angles, strict=True)
        residuals = np.array([residual_of(f, self._marker_residual, q)[0] for f, q in pairs])
        missed = self._lengths - self._prior.map.lengths(angles)
        cost = self.weights.cost(angles, residuals)
        for group in self._prior.groups(angles, elongated=self._elongated):
            own = missed[:, group.muscles]
            cost += float(np.sum(own * group.whiten(own)))
        return cost, residuals

    def normal_equations(self, angles: Floats) -> tuple[Floats, Floats]:
        """Gauss-Newton matrix (K n, K n) and gradient (K n,) at angles (K, n) [rad].

        Both are half those of the cost; the kernel is held fixed.
        """
        count, joints = angles.shape
        expected, jacobian = self._prior.map.lengths_and_jacobian(angles)
        missed = self._lengths - expected
        matrix = np.zeros((count, joints, count, joints))
        gradient = np.zeros((count, joints))
        for k, (q, found) in enumerate(zip(angles, self._observations, strict=True)):
            residual, slope = residual_of(found, self._marker_residual, q)
            own, pull = self.weights.normal_equations(k, q, residual, slope)
            matrix[k, :, k, :] += own
            gradient[k] += pull
        for group in self._prior.groups(angles, elongated=self._elongated):
            arms = jacobian[:, group.muscles]  # (K, muscles of the group, n)
            information = group.whiten(np.eye(count))
            products = np.einsum("kmi,lmj->kilj", arms, arms, optimize=True)
            matrix += information[:, None, :, None] * products
            gradient -= np.einsum("kmi,km->ki", arms, group.whiten(missed[:, group.muscles]))
        size = count * joints
        return matrix.reshape(size, size), gradient.ravel()


class FitPoint(NamedTuple):
    """Joint angles (K, n) [rad], their cost, and the marker's residuals (K, 6) [m, rad]."""

    angles: Floats
    cost: float
    residuals: Floats


def descend(
    problem: FitProblem,
    start: Floats,
    low: Floats,
    high: Floats,
    options: ObservationFitOptions,
) -> tuple[FitPoint, bool]:
    """Lowest point that is found by damped Gauss-Newton steps, and whether it is a minimum.

    Args:
        problem: the cost.
        start: angles (K, n) [rad] to start from.
        low: lowest angle of each joint (n,) [rad].
        high: highest angle of each joint (n,) [rad].
        options: limits of the fit.
    """
    here, damping = FitPoint(start, *problem.cost(start)), START_DAMPING
    for _ in range(options.steps):
        there, damping = _step(problem, here, damping, low, high)
        if there is None:
            return here, True
        moved, gained = float(np.abs(there.angles - here.angles).max()), here.cost - there.cost
        here, damping = there, max(damping / 10.0, LEAST_DAMPING)
        if moved < options.tolerance or gained < options.gain:
            return here, True
    return here, False


def _step(
    problem: FitProblem, here: FitPoint, damping: float, low: Floats, high: Floats
) -> tuple[FitPoint | None, float]:
    """The next point, None if no step lowers the cost; and the damping that it took."""
    matrix, gradient = problem.normal_equations(here.angles)
    rising = gradient.reshape(here.angles.shape) >= 0.0
    held = np.where(rising, here.angles <= low, here.angles >= high)  # pushed against their limits
    free = np.flatnonzero(~held)
    slope, curvature = gradient[free], matrix[np.ix_(free, free)]
    scale = np.diag(curvature)
    while damping < MOST_DAMPING:
        damped = cho_factor(curvature + np.diag(damping * scale))
        step = np.zeros(here.angles.shape)
        step.flat[free] = -cho_solve(damped, slope)
        angles = np.clip(here.angles + np.clip(step, -LARGEST_STEP, LARGEST_STEP), low, high)
        there = FitPoint(angles, *problem.cost(angles))
        if there.cost <= here.cost:
            return there, damping
        damping *= 10.0
    return None, damping
