"""Maps of other methods, which learn from the same pairs (paper, sec. I and II).

Each starts from the nominal model, as ours does, and corrects it for each group of joints and
muscles with the measured pairs (joint angles, lengths):

* polynomials of the nominal lengths (Ookubo, Jantsch), with ridge regression of their coefficients;
* a table (Nakanishi) of the residuals, interpolated between the nearest entries;
* a Gaussian process of the residuals.

Ridge regression is a Gaussian process, too, so `Regression` is used for both. The standard
deviation of the zero of a muscle is given. Scale and smoothness of the error in shape and the noise
of the pairs are chosen at each update by the marginal likelihood, so nothing is tuned on robots.
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
"""Inputs, shapes (A, k) and (B, k) [rad] -> correlation of the errors, shape (A, B)."""

DIFFERENCE = 1e-4
"""Step of the central differences for Jacobians [rad]."""
SAMPLES = 6000
"""Number of postures to which the polynomials are fitted."""
SHAPES = (0.0025, 0.005, 0.01, 0.02)
"""Standard deviations of a muscle's error in shape to choose from [m]."""
NOISES = (0.001, 0.002, 0.004)
"""Standard deviations of the pairs to choose from [m]."""
WIDTHS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Widths of the radial kernel to choose from [rad]."""
NEIGHBOURS = 8
"""Number of entries of a table between which is interpolated."""


@dataclass(frozen=True)
class Correction:
    """Correction of the lengths of a group's muscles.

    Attributes:
        joints, muscles: indices of those of the group.
        at: angles of these joints, shape (B, k) [rad] -> correction, shape (B, m) [m].
    """

    joints: Ints
    muscles: Ints
    at: Callable[[Floats], Floats]


@dataclass(frozen=True)
class CorrectedMap:
    """A map with a correction for each group, and a Jacobian by central differences.

    Attributes:
        base: postures, shape (B, n) [rad] -> uncorrected lengths, shape (B, m) [m].
        corrections: of the groups; empty without measurements.
    """

    base: Callable[[Floats], Floats]
    corrections: Sequence[Correction] = ()

    def lengths(self, q: Floats) -> Floats:
        """Muscle lengths [m]: shape (n,) -> (m,), or (B, n) -> (B, m)."""
        postures = np.atleast_2d(q)
        lengths = self.base(postures)
        for part in self.corrections:
            lengths[:, part.muscles] += part.at(postures[:, part.joints])
        return lengths if np.ndim(q) == 2 else lengths[0]

    def lengths_and_jacobian(self, q: Floats) -> tuple[Floats, Floats]:
        """Lengths, shape (m,) [m], and Jacobian, shape (m, n) [m/rad], at a posture, shape (n,)."""
        moves = DIFFERENCE * np.eye(len(q))
        around = self.lengths(np.vstack([q, q + moves, q - moves]))
        here, up, down = np.split(around, [1, 1 + len(q)])
        return here[0], (up - down).T / (2.0 * DIFFERENCE)


class Polynomial:
    """All products of up to ``degree`` of a group's joint angles, scaled to [-1, 1] over a box.

    Args:
        low: lower corner of the box, shape (k,) [rad].
        high: upper corner.
        degree: highest degree.
    """

    def __init__(self, low: Floats, high: Floats, degree: int) -> None:
        self._centre, self._scale = (low + high) / 2.0, (high - low) / 2.0
        self._factors = [
            list(factors)
            for count in range(1, degree + 1)
            for factors in combinations_with_replacement(range(len(low)), count)
        ]

    def __call__(self, x: Floats) -> Floats:
        """Terms without the constant, shape (B, t), at angles, shape (B, k) [rad]."""
        z = (x - self._centre) / self._scale
        return np.stack([np.prod(z[:, f], axis=1) for f in self._factors], axis=1)


class TermCorrelation:
    """Correlation of ridge regression: products of terms, centred and scaled on typical inputs."""

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
class RadialCorrelation:
    """The radial basis function exp(-d^2 / 2 width^2), width in rad."""

    width: float

    def __call__(self, a: Floats, b: Floats) -> Floats:
        """See `Correlation`."""
        return np.exp(-0.5 * distances(a, b) ** 2 / self.width**2)


def distances(a: Floats, b: Floats) -> Floats:
    """Euclidean distances, shape (A, B) [rad]."""
    return np.linalg.norm(a[:, None] - b[None], axis=2)


class _Fit(NamedTuple):
    """A kernel with its log marginal likelihood up to a constant."""

    evidence: float
    correlation: Correlation
    shape: float
    weights: Floats


class Regression:
    """Gaussian process of a group's residuals: an offset, a shape and noise.

    Args:
        inputs: joint angles of the pairs, shape (K, k) [rad], K > 0.
        residuals: of the lengths, shape (K, m) [m].
        correlations: of the shape, to choose from.
        offset: standard deviation of the offset [m].
    """

    def __init__(
        self, inputs: Floats, residuals: Floats, correlations: Sequence[Correlation], offset: float
    ) -> None:
        self._inputs, self._offset = inputs, offset
        fits = []
        for correlation in correlations:
            gram = correlation(inputs, inputs)
            for shape, noise in product(SHAPES, NOISES):
                covariance = offset**2 + shape**2 * gram + noise**2 * np.eye(len(inputs))
                fits.append(_fit(covariance, residuals, correlation, shape))
        self.chosen = max(fits, key=lambda fit: fit.evidence)

    def __call__(self, x: Floats) -> Floats:
        """Expected residuals, shape (B, m) [m], at angles, shape (B, k) [rad]."""
        fit = self.chosen
        return (self._offset**2 + fit.shape**2 * fit.correlation(x, self._inputs)) @ fit.weights


def _fit(covariance: Floats, residuals: Floats, correlation: Correlation, shape: float) -> _Fit:
    factor = cho_factor(covariance, lower=True)
    weights = cho_solve(factor, residuals)
    spread = residuals.shape[1] * np.sum(np.log(np.diag(factor[0])))
    return _Fit(float(-0.5 * np.sum(residuals * weights) - spread), correlation, shape, weights)


@dataclass(frozen=True)
class Table:
    """Table of measured residuals, interpolated with inverse squares of distances.

    Attributes:
        inputs: joint angles, shape (K, k) [rad], K > 0.
        residuals: of the lengths, shape (K, m) [m].
    """

    inputs: Floats
    residuals: Floats

    def __call__(self, x: Floats) -> Floats:
        """Interpolate residuals, shape (B, m) [m], at angles, shape (B, k) [rad]."""
        away = distances(x, self.inputs)
        nearest = np.argsort(away, axis=1, kind="stable")[:, :NEIGHBOURS]
        weight = 1.0 / (np.take_along_axis(away, nearest, axis=1) ** 2 + 1e-12)
        weight /= weight.sum(axis=1, keepdims=True)
        return np.einsum("bk,bkm->bm", weight, self.residuals[nearest])


class Baselines:
    """Several methods that make maps from pairs.

    Args:
        nominal: map trained on the nominal model, in place of that model.
        typical: postures, shape (N, n) [rad]; the polynomials are fitted in their bounding box,
            where they fit better than in the whole joint ranges.
    """

    def __init__(self, nominal: JointMuscleMap, typical: Floats) -> None:
        self._nominal = nominal
        self._offset = PriorOptions().offset
        low, high = typical.min(axis=0), typical.max(axis=0)
        samples = np.random.default_rng(0).uniform(low, high, (SAMPLES, len(low)))
        lengths = nominal.lengths(samples)
        self._polynomials = {}
        for degree in (2, 3, 4):
            by_group = []
            for group in nominal.groups:
                joints = group.joint_index
                terms = Polynomial(low[joints], high[joints], degree)
                values = _with_constant(terms(samples[:, joints]))
                weights = np.linalg.lstsq(values, lengths[:, group.muscle_index])[0]
                by_group.append((terms, weights, [TermCorrelation(terms, typical[:, joints])]))
            self._polynomials[degree] = by_group

    def polynomial(self, degree: int, pairs: Pairs) -> CorrectedMap:
        """Polynomials of the nominal lengths, corrected by ridge regression of the pairs."""
        by_group = self._polynomials[degree]

        def base(postures: Floats) -> Floats:
            lengths = np.empty((len(postures), len(self._nominal.muscles)))
            for group, (terms, weights, _) in zip(self._nominal.groups, by_group, strict=True):
                values = _with_constant(terms(postures[:, group.joint_index]))
                lengths[:, group.muscle_index] = values @ weights
            return lengths

        return self._regressed(base, pairs, [correlations for _, _, correlations in by_group])

    def process(self, pairs: Pairs) -> CorrectedMap:
        """Nominal map with a Gaussian process of its residuals, with a radial kernel."""
        correlations: list[Correlation] = [RadialCorrelation(width) for width in WIDTHS]
        return self._regressed(
            self._nominal.lengths, pairs, [correlations] * len(self._nominal.groups)
        )

    def table(self, pairs: Pairs) -> CorrectedMap:
        """Nominal map with a table of its residuals."""
        return self._corrected(
            self._nominal.lengths, pairs, lambda rank, inputs, residuals: Table(inputs, residuals)
        )

    def _regressed(
        self,
        base: Callable[[Floats], Floats],
        pairs: Pairs,
        correlations: Sequence[Sequence[Correlation]],
    ) -> CorrectedMap:
        return self._corrected(
            base,
            pairs,
            lambda rank, inputs, residuals: Regression(
                inputs, residuals, correlations[rank], self._offset
            ),
        )

    def _corrected(
        self,
        base: Callable[[Floats], Floats],
        pairs: Pairs,
        correct: Callable[[int, Floats, Floats], Callable[[Floats], Floats]],
    ) -> CorrectedMap:
        """Map with the correction ``correct(index, inputs, residuals)`` for each group."""
        if not len(pairs.postures):
            return CorrectedMap(base)
        residuals = pairs.lengths - base(pairs.postures)
        parts = []
        for rank, group in enumerate(self._nominal.groups):
            joints, muscles = group.joint_index, group.muscle_index
            at = correct(rank, pairs.postures[:, joints], residuals[:, muscles])
            parts.append(Correction(joints, muscles, at))
        return CorrectedMap(base, parts)


def _with_constant(values: Floats) -> Floats:
    return np.hstack([np.ones((len(values), 1)), values])
