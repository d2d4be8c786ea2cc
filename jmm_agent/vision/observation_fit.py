"""Many looks at the hand and what the wires measured, fitted together.

One look has six numbers and the arm fourteen joints, so inverse kinematics from one look leaves
joints wrong that the look cannot tell apart. But the wires' error is no accident of each posture:
lengths zeroed at a wrong posture or a point that lies elsewhere make a smooth function of the
joint angles, the same in all looks. Write the measured lengths of look k as

    l_k = f(theta_k) + delta(theta_k) + e_k

with the drawing's map f, and let delta be a Gaussian process whose kernel is that of the output
layer's prior (`MapPrior`). Then all joint angles theta_1..theta_K are found at once, with delta
integrated out:

    min  sum_k |log(P_vision,k^-1 P(theta_k))|^2_V  +  sum_m r_m' (Phi Phi' + s^2 I)^-1 r_m,
    r_m = (l_km - f_m(theta_k))_k,

by Gauss-Newton steps inside the joint limits; joints that the cost pushes against a limit are held
there, and the others find their way. The paper (sec. III-C) solves each look alone, with
the least movement from the estimate; `fit_alone` does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from jmm_agent.kinematics.bounded_least_squares import minimise
from jmm_agent.mapping.prior import MapPrior
from jmm_agent.types import Floats

Sight = Callable[[Floats, Floats], tuple[Floats, Floats]]
"""(q (n,), pose_marker_in_camera (4, 4)) -> error (6,) [m, rad] and its Jacobian (6, n)."""


ALONE_STEPS = 100
"""Gauss-Newton steps at most for one look alone."""


class MarkerObservation(NamedTuple):
    """One settled posture in which the marker was seen.

    Attributes:
        pose: pose_marker_in_camera (4, 4), measured.
        lengths: measured lengths (m,) [m].
        guess: joint angles (n,) [rad] to start from, the estimate of the time.
    """

    pose: Floats
    lengths: Floats
    guess: Floats


@dataclass(frozen=True)
class ObservationFitOptions:
    """How sure the fit is of what.

    Attributes:
        position_noise: of the marker's position in the camera frame [m].
        rotation_noise: of the marker's orientation [rad].
        steps: Gauss-Newton steps at most.
        tolerance: a step smaller than this ends the fit [rad].
        gain: and one that lowers the cost, which is twice a negative log-likelihood, by less.
        limit_margin: how far outside its limits a joint may be found [rad].
        memory: number of looks that are kept, the newest.
        least_movement: pull towards the estimate when a look is solved alone [1/rad^2].
        give_evidence: least logarithm of the Bayes factor to believe that a wire gave for good;
            infinite to believe that wires never do.
        give_recent: a wire is only believed to have given among this many newest looks.
    """

    position_noise: float = 0.003
    rotation_noise: float = 0.01
    steps: int = 30
    tolerance: float = 1e-4
    gain: float = 0.01
    limit_margin: float = 0.02
    memory: int = 60
    least_movement: float = 0.1
    give_evidence: float = 4.0
    give_recent: int = 5


class ObservationFit(NamedTuple):
    """Joint angles of all looks (K, n) [rad], whether the fit came to rest, and what vision says.

    `sight_error` holds for each look the norms of position [m] and rotation [rad] left over.
    """

    angles: Floats
    converged: bool
    sight_error: Floats


def fit_observations(
    observations: Sequence[MarkerObservation],
    prior: MapPrior,
    sight: Sight,
    limits: Floats,
    options: ObservationFitOptions,
    start: Floats | None = None,
    gave: Floats | None = None,
) -> ObservationFit:
    """Joint angles of all looks at once (module docstring).

    Args:
        looks: K looks.
        prior: what is known of the map's error.
        sight: error of the marker's pose at a posture.
        limits: (n, 2) lowest and highest angles [rad].
        start: angles (K, n) to start from; the looks' guesses if left out.
        gave: (K, m) how often each wire gave for good since each look; never if left out.
    """
    low, high = limits[:, 0] - options.limit_margin, limits[:, 1] + options.limit_margin
    guesses = np.array([look.guess for look in observations]) if start is None else start
    angles = np.clip(guesses, low, high)
    problem = ObservationProblem(observations, prior, sight, options, gave)
    cost, errors = problem.cost(angles)
    damping, converged = 1e-3, False
    for _ in range(options.steps):
        matrix, gradient = problem.normal_equations(angles)
        rising = gradient.reshape(angles.shape) >= 0.0
        held = np.where(rising, angles <= low, angles >= high)  # pushed against their limits
        free = np.flatnonzero(~held)
        slope, curvature = gradient[free], matrix[np.ix_(free, free)]
        scale = np.diag(curvature)
        while damping < 1e6:
            damped = cho_factor(curvature + np.diag(damping * scale))
            step = np.zeros(angles.shape)
            step.flat[free] = -cho_solve(damped, slope)
            trial = np.clip(angles + np.clip(step, -0.3, 0.3), low, high)
            trial_cost, trial_errors = problem.cost(trial)
            if trial_cost <= cost:
                break
            damping *= 10.0
        else:  # no step lowers the cost
            converged = True
            break
        moved, gained = float(np.abs(trial - angles).max()), cost - trial_cost
        angles, cost, errors = trial, trial_cost, trial_errors
        damping = max(damping / 10.0, 1e-6)
        if moved < options.tolerance or gained < options.gain:
            converged = True
            break
    norms = np.column_stack(
        [np.linalg.norm(errors[:, :3], axis=1), np.linalg.norm(errors[:, 3:], axis=1)]
    )
    return ObservationFit(angles, converged, norms)


def fit_alone(
    look: MarkerObservation, sight: Sight, limits: Floats, options: ObservationFitOptions
) -> ObservationFit:
    """Joint angles of one look, as near as possible to its guess: the paper's IK (sec. III-C)."""
    low, high = limits[:, 0] - options.limit_margin, limits[:, 1] + options.limit_margin
    root = np.repeat([1.0 / options.position_noise, 1.0 / options.rotation_noise], 3)

    def residual(q: Floats) -> tuple[Floats, Floats]:
        error, slope = sight(q, look.pose)
        return root * error, root[:, None] * slope

    start = np.clip(look.guess, low, high)
    pull = options.least_movement * np.eye(len(start))
    found = minimise(residual, start, low, high, pull, ALONE_STEPS)
    error = sight(found.x, look.pose)[0]
    norms = np.array([[np.linalg.norm(error[:3]), np.linalg.norm(error[3:])]])
    return ObservationFit(found.x[None], found.stationary, norms)


class ObservationProblem:
    """What `fit_observations` minimises; joint angles are (K, n) [rad]."""

    def __init__(
        self,
        observations: Sequence[MarkerObservation],
        prior: MapPrior,
        sight: Sight,
        options: ObservationFitOptions,
        gave: Floats | None = None,
    ) -> None:
        self._observations, self._prior, self._sight, self._gave = observations, prior, sight, gave
        self._lengths = np.array([look.lengths for look in observations])
        self._weight = np.repeat([options.position_noise**-2, options.rotation_noise**-2], 3)

    def cost(self, angles: Floats) -> tuple[float, Floats]:
        """Cost, and the errors of sight (K, 6)."""
        pairs = zip(angles, self._observations, strict=True)
        errors = np.array([self._sight(q, look.pose)[0] for q, look in pairs])
        residual = self._lengths - self._prior.map.lengths(angles)
        cost = float(np.sum(self._weight * errors**2))
        for group in self._prior.groups(angles, gave=self._gave):
            mine = residual[:, group.muscles]
            cost += float(np.sum(mine * group.whiten(mine)))
        return cost, errors

    def normal_equations(self, angles: Floats) -> tuple[Floats, Floats]:
        """Gauss-Newton matrix (K n, K n) and gradient (K n,), the kernel held fixed."""
        count, joints = angles.shape
        expected, jacobian = self._prior.map.lengths_and_jacobian(angles)
        residual = self._lengths - expected
        matrix = np.zeros((count, joints, count, joints))
        gradient = np.zeros((count, joints))
        for k, (q, look) in enumerate(zip(angles, self._observations, strict=True)):
            error, slope = self._sight(q, look.pose)
            matrix[k, :, k, :] += slope.T @ (self._weight[:, None] * slope)
            gradient[k] += slope.T @ (self._weight * error)
        for group in self._prior.groups(angles, gave=self._gave):
            arms = jacobian[:, group.muscles]  # (K, k, n)
            information = group.whiten(np.eye(count))
            products = np.einsum("kmi,lmj->kilj", arms, arms, optimize=True)
            matrix += information[:, None, :, None] * products
            gradient -= np.einsum("kmi,km->ki", arms, group.whiten(residual[:, group.muscles]))
        size = count * joints
        return matrix.reshape(size, size), gradient.ravel()
