"""Noise model: whitens residuals for the fit and selection splits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from reality_gap.inference.whitening import (
    Whitening,
    explained_by_tolerances,
    variance_inflation,
    whitening,
)
from reality_gap.study.measurements import Measured
from reality_gap.study.splits import FIT, SELECT, split
from reality_gap.types import Floats

WIDENINGS = 8
"""Largest number of steps in which the variance of the channels is found."""
ENOUGH = 1.1
"""Mean square of a whitened channel up to which its variance is that of the noise."""

FAR = 25.0
"""Variance that is not explained from which on a model is wrong by many noises [noise^2]."""


@dataclass(frozen=True)
class NoiseModel:
    """Distribution of the residual of a right model; see `reality_gap.inference.whitening`.

    Attributes:
        measured: the readings.
        tolerances: change of the residual by each tolerance in units of noise, shape (n, p).
        inflation: how many readings count as one, by reading, shape (n,).
        variance: of the errors that are not explained, by reading, at least 1, shape (n,); a part
            of the inflation [noise^2].
    """

    measured: Measured
    tolerances: Floats
    inflation: Floats
    variance: Floats

    @property
    def is_far(self) -> bool:
        """Whether the model is wrong by many noises."""
        return float(self.variance.max()) > FAR

    @property
    def correlation(self) -> Floats:
        """How many autocorrelated readings count as one, by reading, shape (n,)."""
        return self.inflation / self.variance

    def log_likelihood(self, residual: Floats) -> float:
        """Return the log likelihood of a residual (n,), apart from a constant [nats]."""
        use = self.whiten.use
        scaled = self.tolerances[use] * self.whiten.weight[:, None]
        _, shared = np.linalg.slogdet(np.eye(scaled.shape[1]) + scaled.T @ scaled)
        own = np.sum(np.log(self.variance[use]) / self.correlation[use])
        return -0.5 * float(np.sum(self.whiten(residual) ** 2) + own + shared)

    def evidence_of_explained(self, residual: Floats) -> float:
        """Return half the square of what tolerances explain of a residual (n,) [nats].

        It is the evidence that a cause with this effect would have, were there no tolerances.
        """
        use = self.whiten.use
        found = explained_by_tolerances(self.tolerances, self.inflation, use, residual)
        return 0.5 * float(np.sum(found[use] ** 2 / self.inflation[use]))

    @cached_property
    def whiten(self) -> Whitening:
        """Whitening of the fit and selection splits together."""
        return whitening(self.tolerances, self.inflation, split(self.measured) <= SELECT)

    @cached_property
    def whiten_fit(self) -> Whitening:
        """Whitening of the fit split."""
        return whitening(self.tolerances, self.inflation, split(self.measured) == FIT)

    def inflated(self, remainder: Floats) -> NoiseModel:
        """Return a noise model in which channels that are not explained count for less.

        The variance of a channel is its mean square where that exceeds the noise (the model is
        wrong by that much), times how many of its autocorrelated readings count as one.

        Call this on a noise model without inflation.

        Args:
            remainder: residual that is used, shape (n,).
        """
        wider = self._widened(remainder)
        channel = self.measured.channel[self.whiten.use]
        found = variance_inflation(wider.whiten(remainder), channel)
        return replace(wider, inflation=wider.inflation * self._by_channel(found))

    def widened(self, remainder: Floats) -> NoiseModel:
        """Return a noise model with the variance that a remainder (n,) has, and as correlated."""
        ones = np.ones(len(remainder))
        plain = replace(self, inflation=ones, variance=ones)
        wider = plain._widened(remainder)
        return replace(wider, inflation=wider.variance * self.correlation)

    def alike(self) -> NoiseModel:
        """Return a noise model in which readings of all channels are equally correlated.

        The same number of readings count in all channels together. Otherwise a channel would count
        for less, the more smoothly a model is wrong there.
        """
        common = 1.0 / float(np.mean(1.0 / self.correlation[self.whiten.use]))
        return replace(self, inflation=self.variance * common)

    def _widened(self, remainder: Floats) -> NoiseModel:
        """Return a noise model with the likeliest variance of each channel, at least the noise's.

        Variance of the noise explains what tolerances explain less well than before, so that it is
        found in several steps.
        """
        wider, channel = self, self.measured.channel[self.whiten.use]
        for _ in range(WIDENINGS):
            square = np.bincount(channel, wider.whiten(remainder) ** 2)
            power = square / np.maximum(np.bincount(channel), 1)
            if power.max() <= ENOUGH:
                break
            found = np.maximum(1.0, power)[channel]
            variance = wider.variance * self._by_channel(found)
            wider = replace(wider, inflation=variance, variance=variance)
        return wider

    def _by_channel(self, values: Floats) -> Floats:
        """Return a value of each channel for all readings (n,), from those in use (u,)."""
        found = np.ones(len(self.measured.channel))
        channel = self.measured.channel[self.whiten.use]
        for one in np.unique(channel):
            found[self.measured.channel == one] = values[channel == one][0]
        return found


def independent_noise(measured: Measured, tolerances: Floats) -> NoiseModel:
    """Return a noise model without inflation: all readings count in full."""
    ones = np.ones(len(measured.value))
    return NoiseModel(measured, tolerances, ones, ones)
