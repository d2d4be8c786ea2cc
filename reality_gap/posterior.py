"""Posterior: what a diagnosis leaves open about a machine, as a mixture of Gaussians.

A branch of the mixture is a hypothesis: causes at their locations, with estimated values. Its
parameters have a joint Gaussian in the coordinates of the estimator, theta (see
`reality_gap.inference.theta`), which is cut at their bounds. Causes that the data cannot
distinguish are in branches of their own, with their probabilities as weights.

A sample is an extended model: the nominal model with the causes of a branch, at values from its
Gaussian.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import ndtr, ndtri

from reality_gap.causes.base import Effects, Values
from reality_gap.errors import StudyError
from reality_gap.extended import Effect, Extended
from reality_gap.simulation.hypothesis import Candidate, Hypothesis, Part, build
from reality_gap.study.system import System
from reality_gap.types import Bools, Floats

TRIES = 200
"""Number of draws from a Gaussian after which it is no longer hoped that one is within bounds."""
SWEEPS = 60
"""Number of Gibbs sweeps over all parameters that replace such draws."""
MOST = 100_000
"""Largest number of samples."""


@dataclass(frozen=True)
class Branch:
    """One hypothesis of a posterior.

    Attributes:
        hypothesis: candidates with their estimated values, in SI units.
        covariance: of theta, the parameters of all candidates in their order, in scales from their
            null values, shape (p, p); parameters without variance keep their values.
        weight: probability of the hypothesis; those of a posterior sum to 1.
    """

    hypothesis: Hypothesis
    covariance: Floats
    weight: float = 1.0

    @cached_property
    def mean(self) -> Floats:
        """Theta of the estimated values, shape (p,)."""
        pairs = zip(self._parameters, self._values, strict=True)
        return np.array([(value - p.null) / p.scale for p, value in pairs])

    @cached_property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper bounds of theta, shape (p,) each."""
        ends = [
            sorted(((p.low - p.null) / p.scale, (p.high - p.null) / p.scale))
            for p in self._parameters
        ]
        low, high = np.array(ends).reshape(-1, 2).T
        return low, high

    def draw(self, random: np.random.Generator) -> list[Part]:
        """Return the candidates with values from the Gaussian within the bounds."""
        theta, free = self.mean.copy(), self._free
        if free.any():
            theta[free] = self._gaussian.draw(random)
        values = iter(theta)
        return [
            (
                candidate,
                {
                    p.name: float(np.clip(p.null + next(values) * p.scale, p.low, p.high))
                    for p in candidate.parameters
                },
            )
            for candidate, _ in self.hypothesis
        ]

    @property
    def _parameters(self) -> list[Any]:
        return [p for candidate, _ in self.hypothesis for p in candidate.parameters]

    @property
    def _values(self) -> list[float]:
        return [v[p.name] for candidate, v in self.hypothesis for p in candidate.parameters]

    @cached_property
    def _free(self) -> Bools:
        """Which parameters vary, shape (p,)."""
        low, high = self.bounds
        return np.asarray((np.diag(self.covariance) > 0.0) & (low < high))

    @cached_property
    def _gaussian(self) -> TruncatedGaussian:
        free, (low, high) = self._free, self.bounds
        covariance = self.covariance[np.ix_(free, free)]
        return TruncatedGaussian(self.mean[free], covariance, low[free], high[free])


@dataclass(frozen=True)
class TruncatedGaussian:
    """A Gaussian that is cut at bounds.

    Attributes:
        mean: shape (p,).
        covariance: positive definite, shape (p, p).
        low, high: bounds, shape (p,).
    """

    mean: Floats
    covariance: Floats
    low: Floats
    high: Floats

    def draw(self, random: np.random.Generator) -> Floats:
        """Return one sample, shape (p,).

        The whole Gaussian is sampled until a sample is within the bounds. If that takes too long,
        as with many parameters at their bounds, one is sampled after the other, given the rest.
        """
        for _ in range(TRIES):
            found = self.mean + self._root @ random.standard_normal(len(self.mean))
            if np.all((self.low <= found) & (found <= self.high)):
                return np.asarray(found)
        return self._draw_by_turns(random)

    @cached_property
    def _root(self) -> Floats:
        return np.asarray(np.linalg.cholesky(self.covariance), dtype=np.float64)

    @cached_property
    def _precision(self) -> Floats:
        return np.asarray(np.linalg.inv(self.covariance), dtype=np.float64)

    def _draw_by_turns(self, random: np.random.Generator) -> Floats:
        """Return the state of a Gibbs sampler that started at the mean, shape (p,)."""
        theta, precision = np.clip(self.mean, self.low, self.high), self._precision
        sizes = 1.0 / np.sqrt(np.diag(precision))
        for _ in range(SWEEPS):
            shares = random.uniform(size=len(theta))
            for j, size in enumerate(sizes):
                pull = precision[j] @ (theta - self.mean)
                centre = theta[j] - pull * size**2
                ends = (self.low[j] - centre) / size, (self.high[j] - centre) / size
                step = float(_between(*ends, shares[j]))
                theta[j] = np.clip(centre + size * step, self.low[j], self.high[j])
        return theta


def _between(low: float, high: float, share: float) -> float:
    """Return the quantile ``share`` of the standard Gaussian between two ends."""
    if low > 0.0:  # the upper tail is exact only as a lower one
        return -_between(-high, -low, 1.0 - share)
    found = float(ndtri(ndtr(low) + share * (ndtr(high) - ndtr(low))))
    return found if np.isfinite(found) else high  # so far out that the Gaussian is zero


@dataclass(frozen=True)
class Posterior:
    """What a diagnosis leaves open about a machine.

    Attributes:
        system: the study's model and its elements; its file must still exist when it is sampled.
        usual: effects that all machines have and nominal models lack, which are in every sample.
        branches: hypotheses with their weights, the likeliest first.
    """

    system: System
    usual: Hypothesis
    branches: tuple[Branch, ...]

    def sample(self, n: int, seed: int = 0) -> list[Extended]:
        """Sample extended models; the first of ``n + 1`` samples are those of ``n``.

        Args:
            n: number of samples, from 1.
            seed: of the samples; the same seed gives the same models.

        Raises:
            StudyError: a number is out of its range, or there is no file of the model any more.
        """
        return [self.extended(parts) for parts in self.hypotheses(n, seed)]

    def hypotheses(self, n: int, seed: int = 0) -> Iterator[list[Part]]:
        """Yield the causes of each sample with their values; see `sample`."""
        weights = np.array([branch.weight for branch in self.branches])
        for random in _streams(n, seed):
            branch = self.branches[int(random.choice(len(weights), p=weights / weights.sum()))]
            yield branch.draw(random)

    def extended(self, parts: Sequence[Part]) -> Extended:
        """Build the model of a sample from its causes, as `hypotheses` yields them."""
        plant = build(self.system, [*self.usual, *parts])
        effects = tuple(
            Effect(candidate.cause, candidate.location, dict(values))
            for candidate, values in parts
            if _acts_beside(self.system, candidate, values)
        )
        return Extended(plant.spec, effects)


def normalised(branches: list[Branch]) -> tuple[Branch, ...]:
    """Return branches with weights that sum to 1, the likeliest first."""
    total = sum(branch.weight for branch in branches)
    scaled = [replace(branch, weight=branch.weight / total) for branch in branches]
    return tuple(sorted(scaled, key=lambda branch: -branch.weight))


def _streams(n: int, seed: int) -> list[np.random.Generator]:
    """Return a generator for each sample."""
    for name, value, low, high in (("n", n, 1, MOST), ("seed", seed, 0, None)):
        whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
        if not whole or value < low or (high is not None and value > high):
            limit = f"{low} or more" if high is None else f"from {low} to {high}"
            raise StudyError(f"{name} must be a whole number, {limit}, not {value!r}")
    return np.random.default_rng(int(seed)).spawn(int(n))


def _acts_beside(system: System, candidate: Candidate, values: Values) -> bool:
    """Return whether a candidate has effects that MuJoCo cannot express, in all logs."""
    attach = candidate.cause.attach
    if attach is None or candidate.location.log:
        return False
    if all(values[p.name] == p.null for p in candidate.parameters):
        return False
    found = Effects()
    attach(found, system, candidate.location, values)
    return any((found.commands, found.hooks, found.readings, found.motions, found.efforts))
