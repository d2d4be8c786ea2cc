"""Zeroing test: whether all muscle lengths were zeroed anew before the newest observations.

After a power cycle lengths may count from another posture than before. All lengths that were
measured before then differ from the new ones by an unknown number for each muscle,

    l_km = f_m(theta_k) + delta_m(theta_k) + z_m + e_km    for all k before,

with the standard deviation s = `PriorOptions.zeroing` of z. If only the zero posture differs, by
angles x, then z = G(0) x with the map's Jacobian G, which is fewer unknowns than muscles. The test
compares the evidence of both hypotheses with that of at most `MOST_SINGLE` muscles that were
elongated, each for itself. Angles of earlier observations are held at their fit; those of the
newest, and x, are integrated out about their most probable value with the Gauss-Newton matrix H
(Laplace's method):

    log p = -1/2 sum_m (r_m' C_m^-1 r_m + log det C_m) - 1/2 (cost of the poses) - 1/2 log det H.

A muscle's own elongation x adds x u to its residuals, with u = 1 before and 0 after. Its evidence
is, to first order, that of `permanent_elongation`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from jmm_agent.mapping.prior import GroupKernel, MapPrior, without_unknown
from jmm_agent.types import Floats
from jmm_agent.vision.marker_observation import (
    MarkerObservation,
    ObservationWeights,
    PoseResidual,
    residual_of,
)
from jmm_agent.vision.observation_fit import ObservationFitOptions

MOST_SINGLE = 5
"""Largest number of muscles that may have been elongated, each for itself."""
SMALLER = 0.5
"""A zeroing by this share of its standard deviation is tested, too [1]."""
STEPS = 12
"""Largest number of Gauss-Newton steps."""
LARGEST_STEP = 0.3
"""Largest change of a joint angle in one step [rad]."""
LEAST_ARM = 1e-3
"""Least moment arm over all joints that is assumed of a robot's muscles [m]."""
MOST_DAMPING = 1e6
"""Damping at which no smaller step is tried [1]."""


class _Evidence(NamedTuple):
    """Logarithm of the evidence, at angles (r, n) [rad], with the factor of H and the gradient.

    With an unknown zero posture, ``angles`` has it as one row more.
    """

    value: float
    angles: Floats
    factor: tuple[Floats, bool]
    gradient: Floats


class _Point(NamedTuple):
    """Twice the negative logarithm of the probability, its Gauss-Newton matrix and gradient."""

    cost: float
    matrix: Floats
    gradient: Floats


class ZeroingTest:
    """Evidence that all lengths were zeroed anew (module docstring).

    Args:
        prior: prior of the map's error, of elongations and of zeroings.
        marker_residual: residual of the marker's pose at a posture.
        limits: lowest and highest angle of each joint (n, 2) [rad].
        options: noise levels, and the evidence from which on an elongation is believed.
        before: observations of before.
        angles: their fitted joint angles (K, n) [rad].
        elongated: number of elongations of each muscle since each of them (K, m), as believed
            before the newest observations.
    """

    def __init__(
        self,
        prior: MapPrior,
        marker_residual: PoseResidual,
        limits: Floats,
        options: ObservationFitOptions,
        before: Sequence[MarkerObservation],
        angles: Floats,
        elongated: Floats,
    ) -> None:
        self._prior, self._marker_residual, self._options = prior, marker_residual, options
        self._low = limits[:, 0] - options.limit_margin
        self._high = limits[:, 1] + options.limit_margin
        lengths, since = without_unknown(np.array([found.lengths for found in before]), elongated)
        self._angles, self._elongated = angles, elongated if since is None else since
        self._missed = lengths - prior.map.lengths(angles)
        self._zero = prior.map.jacobian(np.zeros(len(limits)))
        arm = float(np.sqrt(np.mean(np.sum(self._zero**2, axis=1))))
        self._turn = prior.options.zeroing / max(arm, LEAST_ARM)

    def log_bayes_factor(self, newest: Sequence[MarkerObservation]) -> float:
        """Logarithm of the Bayes factor for a zeroing just before the newest observations.

        Args:
            newest: r observations that were made since.
        """
        self._newest = newest
        options = self._options
        self._weights = ObservationWeights(
            newest, options.position_noise, options.rotation_noise, options.joint_noise
        )
        lengths = np.array([found.lengths for found in newest])
        self._lengths, since = without_unknown(lengths, np.zeros_like(lengths))
        self._since = np.zeros_like(lengths) if since is None else since
        guess = np.array([found.guess for found in newest])
        share = self._prior.zeroing_share
        zeroed = [
            self._evidence(self._elongated + share * part**2, guess) for part in (1.0, SMALLER)
        ]
        most = max(zeroed, key=lambda found: found.value)
        starts = (guess, most.angles)
        none = max(
            (self._evidence(self._elongated, start) for start in starts),
            key=lambda found: found.value,
        )
        again = self._evidence(self._elongated + share, none.angles)
        turned = max(
            self._evidence(
                self._elongated, np.vstack([start, 0.0 * start[:1]]), part * self._turn
            ).value
            for part in (1.0, SMALLER)
            for start in (guess, none.angles)
        )
        return max(most.value, again.value, turned) - self._with_single(none)

    def _with_single(self, here: _Evidence) -> float:
        """Evidence with the muscles elongated that it takes, each for itself."""
        elongated = self._elongated
        for _ in range(MOST_SINGLE):
            gain = self._single(elongated, here)
            muscle = int(gain.argmax())
            if gain[muscle] < self._options.elongation_evidence:
                break
            more = elongated.copy()
            more[:, muscle] += 1.0
            there = self._evidence(more, here.angles)
            if there.value <= here.value:
                break
            elongated, here = more, there
        return here.value

    def _evidence(self, elongated: Floats, start: Floats, turn: float = 0.0) -> _Evidence:
        """Evidence of a history of elongations (K, m), searched from angles (r, n) [rad].

        With the standard deviation ``turn`` [rad] of the zero posture, the last row is its angles.
        """
        low, high = (
            np.broadcast_to(self._low, start.shape),
            np.broadcast_to(self._high, start.shape),
        )
        if turn:
            low, high = low.copy(), high.copy()
            low[-1], high[-1] = -np.inf, np.inf
        q, damping = np.clip(start, low, high), 1e-6
        here = self._at(elongated, q, turn)
        for _ in range(STEPS):
            there, moved = here, q
            while damping < MOST_DAMPING:
                scaled = here.matrix + damping * np.diag(np.diag(here.matrix))
                step = -cho_solve(cho_factor(scaled), here.gradient).reshape(q.shape)
                step = np.clip(step, -LARGEST_STEP, LARGEST_STEP)
                moved = np.clip(q + step, low, high)
                there = self._at(elongated, moved, turn)
                if there.cost <= here.cost:
                    break
                damping *= 10.0
            else:
                break
            gained, change = here.cost - there.cost, float(np.abs(moved - q).max())
            q, here, damping = moved, there, max(damping / 10.0, 1e-6)
            if gained < self._options.gain or change < self._options.tolerance:
                break
        factor = cho_factor(here.matrix)
        log_det = 2.0 * float(np.log(np.diag(factor[0])).sum())
        return _Evidence(-0.5 * (here.cost + log_det), q, factor, here.gradient)

    def _at(self, elongated: Floats, unknown: Floats, turn: float) -> _Point:
        """Cost of a history of elongations (K, m) at angles (r, n), or with a zero posture."""
        q = unknown[:-1] if turn else unknown
        count, joints = q.shape
        before = len(self._angles)
        expected, jacobian = self._prior.map.lengths_and_jacobian(q)
        earlier = self._missed - self._zero @ unknown[-1] if turn else self._missed
        missed = np.vstack([earlier, self._lengths - expected])
        poses = [
            residual_of(found, self._marker_residual, at)
            for found, at in zip(self._newest, q, strict=True)
        ]
        cost = self._weights.cost(q, np.array([residual for residual, _ in poses]))
        matrix = np.zeros((len(unknown), joints, len(unknown), joints))
        gradient = np.zeros((len(unknown), joints))
        for k, pose in enumerate(poses):
            matrix[k, :, k], gradient[k] = self._weights.normal_equations(k, q[k], *pose)
        if turn:
            matrix[-1, :, -1] += np.eye(joints) / turn**2
            gradient[-1] += unknown[-1] / turn**2
            cost += float(np.sum(unknown[-1] ** 2)) / turn**2 + 2.0 * joints * np.log(turn)
            jacobian = np.vstack([jacobian, self._zero[None]])
        steps = np.eye(before + count)[:, before:]  # rows of the residuals that each unknown moves
        if turn:
            steps = np.column_stack([steps, np.arange(before + count) < before])
        for kernel in self._kernels(elongated, q):
            own = missed[:, kernel.muscles]
            white = kernel.whiten(own)
            cost += float(np.sum(own * white)) + len(kernel.muscles) * kernel.log_det
            arms = jacobian[:, kernel.muscles]
            information = steps.T @ kernel.whiten(steps)
            matrix += information[:, None, :, None] * np.einsum("kmi,lmj->kilj", arms, arms)
            gradient -= np.einsum("kmi,km->ki", arms, steps.T @ white)
        size = len(unknown) * joints
        return _Point(cost, matrix.reshape(size, size), gradient.ravel())

    def _kernels(self, elongated: Floats, q: Floats) -> Sequence[GroupKernel]:
        postures = np.vstack([self._angles, q])
        return self._prior.groups(postures, elongated=np.vstack([elongated, self._since]))

    def _single(self, elongated: Floats, here: _Evidence) -> Floats:
        """Logarithm of the Bayes factor (m,) for the elongation of each muscle."""
        size, before = self._prior.options.elongation, len(self._angles)
        expected, jacobian = self._prior.map.lengths_and_jacobian(here.angles)
        missed = np.vstack([self._missed, self._lengths - expected])
        left = cho_solve(here.factor, here.gradient)
        steps = (np.arange(len(missed)) < before).astype(float)
        gain = np.full(elongated.shape[1], -np.inf)
        for kernel in self._kernels(elongated, here.angles):
            white = kernel.whiten(steps)
            for muscle in kernel.muscles:
                pull = (jacobian[:, muscle] * white[before:, None]).ravel()
                known = steps @ white - pull @ cho_solve(here.factor, pull)
                slope = white @ missed[:, muscle] + pull @ left
                known = max(float(known), 0.0)
                gain[muscle] = 0.5 * (slope**2 / (known + size**-2) - np.log1p(size**2 * known))
        return gain
