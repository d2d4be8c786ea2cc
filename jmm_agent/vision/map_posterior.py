"""Posterior of a robot's muscle lengths at any posture, given all its rests.

At a posture q the robot has the lengths F(q) = f(q) - f(z) + delta(q), see
`jmm_agent.vision.rest_fit`. Given the joint angles x of all rests and the zero posture z, delta is
a Gaussian process that was observed at the rests: with the kernel's values k and covariance C of
the rests' lengths, and what these miss, r,

    E F(q) = f(q) - f(z) + k(q)' C^-1 r,    cov = k(q, q') - k(q)' C^-1 k(q').

x is uncertain, too, with the fit's Gauss-Newton matrix H. It moves E F(q) by B(q), so that
B(q) H^-1 B(q')' is added (law of total covariance; the kernel is held fixed).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, solve_triangular

from jmm_agent.mapping.prior import MapPrior
from jmm_agent.types import Floats
from jmm_agent.vision.prior_widths import REGULARISATION, Linearised


class Projected(NamedTuple):
    """Linear functions of the robot's lengths at P postures, and how uncertain they are.

    Attributes:
        rows: the functions of the lengths of each posture (P, a, m).
        features: of each kernel (P, F) [m].
        gains: C^-1 k of each kernel (R, P), for the R rests.
        solved: lower triangle of H, solved for how unknown angles move the functions (X, P, a).
    """

    rows: Floats
    features: list[Floats]
    gains: list[Floats]
    solved: Floats


class MapPosterior:
    """Posterior of the robot's lengths (module docstring).

    Args:
        prior: of the map's error, without zero posture.
        fit: of all rests, at its end.
    """

    def __init__(self, prior: MapPrior, fit: Linearised) -> None:
        self._prior, self._fit = prior, fit
        matrix = fit.matrix.copy()
        matrix[np.diag_indices_from(matrix)] *= 1.0 + REGULARISATION
        self._lower = np.tril(cho_factor(matrix, lower=True)[0])
        groups = enumerate(prior.map.groups)
        ranks = {int(m): rank for rank, group in groups for m in group.muscle_index}
        self._ranks = [ranks[int(kernel.muscles[0])] for kernel in fit.kernels]

    def covariance_of_rest(self, number: int) -> Floats:
        """Covariance of the joint angles of a rest (n, n) [rad^2].

        Args:
            number: of the rest.
        """
        joints = len(self._fit.zero)
        own = np.zeros((len(self._lower), joints))
        own[number * joints : (number + 1) * joints] = np.eye(joints)
        solved = solve_triangular(self._lower, own, lower=True, check_finite=False)
        return np.asarray(solved.T @ solved)

    def lengths(self, postures: Floats) -> Floats:
        """Most probable lengths (P, m) [m] at postures (P, n) [rad]."""
        both = self._prior.map.lengths(np.vstack([postures, self._fit.zero]))
        lengths = both[:-1] - both[-1]
        gains = self._gains(self._features(postures))
        for kernel, gain in zip(self._fit.kernels, gains, strict=True):
            lengths[:, kernel.muscles] += gain.T @ self._fit.missed[:, kernel.muscles]
        return np.asarray(lengths)

    def project(self, postures: Floats, rows: Floats) -> Projected:
        """Linear functions of the lengths.

        Args:
            postures: (P, n) [rad].
            rows: functions of the lengths at each (P, a, m).
        """
        arms, features = self._fit.arms, self._features(postures)
        gains = self._gains(features)
        unknown, _, joints = arms.shape
        moves = np.zeros((unknown, joints, *rows.shape[:2]))
        for kernel, gain in zip(self._fit.kernels, gains, strict=True):
            share = -self._fit.rows.T @ gain  # (unknown, P)
            share[-1] += 1.0
            own, turned = rows[..., kernel.muscles], arms[:, kernel.muscles]
            moves += share[:, None, :, None] * np.einsum(
                "umj,pam->ujpa", turned, own, optimize=True
            )
        flat = moves.reshape(unknown * joints, -1)
        solved = solve_triangular(self._lower, flat, lower=True, check_finite=False)
        return Projected(rows, features, gains, solved.reshape(len(flat), *rows.shape[:2]))

    def covariance(self, one: Projected, other: Projected) -> Floats:
        """Covariance of the functions of P with those of Q postures (P, a, Q, b)."""
        size, shape = len(one.solved), (*one.rows.shape[:2], *other.rows.shape[:2])
        found = one.solved.reshape(size, -1).T @ other.solved.reshape(size, -1)
        found = found.reshape(shape)
        for number, kernel in enumerate(self._fit.kernels):
            explained = one.features[number] @ (kernel.features.T @ other.gains[number])
            own = one.features[number] @ other.features[number].T - explained
            muscles = kernel.muscles
            alike = np.einsum(
                "pam,qbm->paqb", one.rows[..., muscles], other.rows[..., muscles], optimize=True
            )
            found += own[:, None, :, None] * alike
        return np.asarray(found)

    def own_covariance(self, one: Projected) -> Floats:
        """Covariance of the functions of each posture (P, a, a)."""
        found = np.einsum("xpa,xpb->pab", one.solved, one.solved, optimize=True)
        for number, kernel in enumerate(self._fit.kernels):
            gains = kernel.features.T @ one.gains[number]
            own = np.sum(one.features[number] * (one.features[number] - gains.T), axis=1)
            rows = one.rows[..., kernel.muscles]
            found += own[:, None, None] * np.einsum("pam,pbm->pab", rows, rows, optimize=True)
        return np.asarray(found)

    def _features(self, postures: Floats) -> list[Floats]:
        """Features of each kernel (P, F) [m]."""
        groups, known = self._prior.map.groups, dict[int, Floats]()
        for rank in self._ranks:
            if rank not in known:
                known[rank] = self._prior.features(rank, groups[rank].hidden(postures))
        pairs = zip(self._ranks, self._fit.kernels, strict=True)
        return [self._prior.completed(rank, known[rank], one.muscles) for rank, one in pairs]

    def _gains(self, features: list[Floats]) -> list[Floats]:
        """C^-1 k of each kernel (R, P)."""
        pairs = zip(self._fit.kernels, features, strict=True)
        return [kernel.whiten(kernel.features @ own.T) for kernel, own in pairs]
