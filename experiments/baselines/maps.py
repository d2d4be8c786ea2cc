"""Maps that others would use, taught by the same pairs (paper, sec. I and II).

Each begins with the drawing, as ours does, and corrects it per group of joints and muscles by the
pairs (joint angles, lengths) that were measured:

* polynomials of the drawing (Ookubo, Jantsch), their coefficients moved by ridge regression;
* a table (Nakanishi) of what the drawing misses, read by weighing the nearest entries;
* a Gaussian process of what the drawing misses.

Ridge regression is a Gaussian process too, so one `Regression` serves both. It is told how far a
wire's zero may be off. How far its shape may be off, how smooth that is and how exact pairs are, is
chosen anew at each update by the marginal likelihood, so nothing had to be tuned on robots.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement, product
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Pairs
from jmm_agent.mapping.prior import PriorOptions
from jmm_agent.types import Floats, Ints

Correlation = Callable[[Floats, Floats], Floats]
"""Inputs (A, k) and (B, k) [rad] -> how alike the errors are there (A, B), 1 on average."""

DIFFERENCE = 1e-4  # [rad] on either side, for Jacobians
SAMPLES = 6000
SHAPES = (0.0025, 0.005, 0.01, 0.02)
"""Standard deviations of a wire's error in shape to choose from [m]."""
NOISES = (0.001, 0.002, 0.004)
"""Standard deviations of the pairs to choose from [m]."""
WIDTHS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Widths of the radial kernel to choose from [rad]."""
NEIGHBOURS = 8
"""Entries of a table that are weighed."""


@dataclass(frozen=True)
class Correction:
    """What is added to the lengths of a group's muscles.

    Attributes:
        joints, muscles: of the group, as indices.
        at: (B, k) angles of these joints [rad] -> (B, m) [m].
    """

    joints: Ints
    muscles: Ints
    at: Callable[[Floats], Floats]


@dataclass(frozen=True)
class CorrectedMap:
    """A map with a correction for each group; its Jacobian by central differences.

    Attributes:
        base: lengths (B, m) [m] at postures (B, n) [rad] before anything was measured.
        corrections: of the groups, none before anything was measured.
    """

    base: Callable[[Floats], Floats]
    corrections: Sequence[Correction] = ()

    def lengths(self, q: Floats) -> Floats:
        """Muscle lengths [m]: (n,) -> (m,), or (B, n) -> (B, m)."""
        postures = np.atleast_2d(q)
        lengths = self.base(postures)
        for part in self.corrections:
            lengths[:, part.muscles] += part.at(postures[:, part.joints])
        return lengths if np.ndim(q) == 2 else lengths[0]

    def lengths_and_jacobian(self, q: Floats) -> tuple[Floats, Floats]:
        """Lengths (m,) [m] and their Jacobian (m, n) [m/rad] at a posture (n,) [rad]."""
        moves = DIFFERENCE * np.eye(len(q))
        around = self.lengths(np.vstack([q, q + moves, q - moves]))
        here, up, down = np.split(around, [1, 1 + len(q)])
        return here[0], (up - down).T / (2.0 * DIFFERENCE)


class Polynomial:
    """All products of up to ``degree`` of a group's joint angles, scaled to [-1, 1] over a box.

    Args:
        low, high: the box (k,) [rad].
        degree: highest.
    """

    def __init__(self, low: Floats, high: Floats, degree: int) -> None:
        self._centre, self._scale = (low + high) / 2.0, (high - low) / 2.0
        self._factors = [
            list(factors)
            for count in range(1, degree + 1)
            for factors in combinations_with_replacement(range(len(low)), count)
        ]

    def __call__(self, x: Floats) -> Floats:
        """Terms (B, t) at angles (B, k) [rad], without the constant one."""
        z = (x - self._centre) / self._scale
        return np.stack([np.prod(z[:, f], axis=1) for f in self._factors], axis=1)


class TermsAlike:
    """Ridge regression's correlation: products of terms, centred and scaled over typical inputs."""

    def __init__(self, terms: Polynomial, typical: Floats) -> None:
        values = terms(typical)
        self._terms, self._centre = terms, values.mean(axis=0)
        self._scale = 1.0 / np.sqrt(np.sum(values.var(axis=0)))

    def _scaled(self, x: Floats) -> Floats:
        return self._scale * (self._terms(x) - self._centre)

    def __call__(self, a: Floats, b: Floats) -> Floats:
        """See `Correlation`."""
        return self._scaled(a) @ self._scaled(b).T


@dataclass(frozen=True)
class NearAlike:
    """The radial basis function exp(-d^2 / 2 width^2), width in rad."""

    width: float

    def __call__(self, a: Floats, b: Floats) -> Floats:
        """See `Correlation`."""
        return np.exp(-0.5 * distances(a, b) ** 2 / self.width**2)


def distances(a: Floats, b: Floats) -> Floats:
    """Euclidean distances (A, B) [rad]."""
    return np.linalg.norm(a[:, None] - b[None], axis=2)


class _Fit(NamedTuple):
    """A choice of kernel with its evidence (log marginal likelihood, but for a constant)."""

    evidence: float
    alike: Correlation
    shape: float
    weights: Floats


class Regression:
    """Gaussian process of a group's residuals: an offset, a shape and noise.

    Args:
        inputs: joint angles (K, k) [rad] of the pairs, K > 0.
        residuals: (K, m) [m].
        alike: correlations of the shape to choose from.
        offset: standard deviation of the offset [m].
    """

    def __init__(
        self, inputs: Floats, residuals: Floats, alike: Sequence[Correlation], offset: float
    ) -> None:
        self._inputs, self._offset = inputs, offset
        fits = []
        for correlation in alike:
            gram = correlation(inputs, inputs)
            for shape, noise in product(SHAPES, NOISES):
                covariance = offset**2 + shape**2 * gram + noise**2 * np.eye(len(inputs))
                fits.append(_fit(covariance, residuals, correlation, shape))
        self.chosen = max(fits, key=lambda fit: fit.evidence)

    def __call__(self, x: Floats) -> Floats:
        """Expected residuals (B, m) [m] at angles (B, k) [rad]."""
        fit = self.chosen
        return (self._offset**2 + fit.shape**2 * fit.alike(x, self._inputs)) @ fit.weights


def _fit(covariance: Floats, residuals: Floats, alike: Correlation, shape: float) -> _Fit:
    factor = cho_factor(covariance, lower=True)
    weights = cho_solve(factor, residuals)
    spread = residuals.shape[1] * np.sum(np.log(np.diag(factor[0])))
    return _Fit(float(-0.5 * np.sum(residuals * weights) - spread), alike, shape, weights)


@dataclass(frozen=True)
class Table:
    """Residuals at the inputs measured, read by the inverse squares of distances.

    Attributes:
        inputs: joint angles (K, k) [rad], K > 0.
        residuals: (K, m) [m].
    """

    inputs: Floats
    residuals: Floats

    def __call__(self, x: Floats) -> Floats:
        """Residuals (B, m) [m] at angles (B, k) [rad], of the nearest entries."""
        away = distances(x, self.inputs)
        nearest = np.argsort(away, axis=1, kind="stable")[:, :NEIGHBOURS]
        weight = 1.0 / (np.take_along_axis(away, nearest, axis=1) ** 2 + 1e-12)
        weight /= weight.sum(axis=1, keepdims=True)
        return np.einsum("bk,bkm->bm", weight, self.residuals[nearest])


class Baselines:
    """Makes maps from pairs, by several methods.

    Args:
        drawn: the network trained on the drawing, which stands for the drawing here.
        typical: postures (N, n) [rad]; polynomials are fitted in the box that holds them, which
            suits them better than the whole joint ranges.
    """

    def __init__(self, drawn: JointMuscleMap, typical: Floats) -> None:
        self._drawn = drawn
        self._offset = PriorOptions().offset
        low, high = typical.min(axis=0), typical.max(axis=0)
        samples = np.random.default_rng(0).uniform(low, high, (SAMPLES, len(low)))
        lengths = drawn.lengths(samples)
        self._polynomials = {}
        for degree in (2, 3, 4):
            by_group = []
            for group in drawn.groups:
                joints = group.joint_index
                terms = Polynomial(low[joints], high[joints], degree)
                values = _with_constant(terms(samples[:, joints]))
                weights = np.linalg.lstsq(values, lengths[:, group.muscle_index])[0]
                by_group.append((terms, weights, [TermsAlike(terms, typical[:, joints])]))
            self._polynomials[degree] = by_group

    def polynomial(self, degree: int, pairs: Pairs) -> CorrectedMap:
        """The drawing's polynomials, moved by ridge regression of the pairs."""
        by_group = self._polynomials[degree]

        def base(postures: Floats) -> Floats:
            lengths = np.empty((len(postures), len(self._drawn.muscles)))
            for group, (terms, weights, _) in zip(self._drawn.groups, by_group, strict=True):
                values = _with_constant(terms(postures[:, group.joint_index]))
                lengths[:, group.muscle_index] = values @ weights
            return lengths

        return self._regressed(base, pairs, [alike for _, _, alike in by_group])

    def process(self, pairs: Pairs) -> CorrectedMap:
        """The drawing and a Gaussian process with a radial kernel."""
        alike: list[Correlation] = [NearAlike(width) for width in WIDTHS]
        return self._regressed(self._drawn.lengths, pairs, [alike] * len(self._drawn.groups))

    def table(self, pairs: Pairs) -> CorrectedMap:
        """The drawing and a table of what it missed."""
        return self._corrected(
            self._drawn.lengths, pairs, lambda rank, inputs, residuals: Table(inputs, residuals)
        )

    def _regressed(
        self,
        base: Callable[[Floats], Floats],
        pairs: Pairs,
        alike: Sequence[Sequence[Correlation]],
    ) -> CorrectedMap:
        return self._corrected(
            base,
            pairs,
            lambda rank, inputs, residuals: Regression(
                inputs, residuals, alike[rank], self._offset
            ),
        )

    def _corrected(
        self,
        base: Callable[[Floats], Floats],
        pairs: Pairs,
        correct: Callable[[int, Floats, Floats], Callable[[Floats], Floats]],
    ) -> CorrectedMap:
        """A map with corrections by ``correct(rank of the group, inputs, residuals)``."""
        if not len(pairs.postures):
            return CorrectedMap(base)
        missed = pairs.lengths - base(pairs.postures)
        parts = []
        for rank, group in enumerate(self._drawn.groups):
            joints, muscles = group.joint_index, group.muscle_index
            at = correct(rank, pairs.postures[:, joints], missed[:, muscles])
            parts.append(Correction(joints, muscles, at))
        return CorrectedMap(base, parts)


def _with_constant(values: Floats) -> Floats:
    return np.hstack([np.ones((len(values), 1)), values])
