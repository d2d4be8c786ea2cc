"""Noise model: whitens residuals for the fit and selection splits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from reality_gap.inference.whitening import Whitening, variance_inflation, whitening
from reality_gap.study.measurements import Measured
from reality_gap.study.splits import FIT, SELECT, split
from reality_gap.types import Floats


@dataclass(frozen=True)
class NoiseModel:
    """Distribution of the residual of a right model; see `reality_gap.inference.whitening`.

    Attributes:
        measured: the readings.
        tolerances: change of the residual by each tolerance in units of noise, shape (n, p).
        inflation: how many readings count as one, by reading, shape (n,).
    """

    measured: Measured
    tolerances: Floats
    inflation: Floats

    @cached_property
    def whiten(self) -> Whitening:
        """Whitening of the fit and selection splits together."""
        return whitening(self.tolerances, self.inflation, split(self.measured) <= SELECT)

    @cached_property
    def whiten_fit(self) -> Whitening:
        """Whitening of the fit split."""
        return whitening(self.tolerances, self.inflation, split(self.measured) == FIT)

    def inflated(self, remainder: Floats) -> NoiseModel:
        """Return a noise model in which readings of autocorrelated channels count for less.

        Call this on a noise model without inflation.

        Args:
            remainder: residual whose autocorrelation is used, shape (n,).
        """
        channel = self.measured.channel[self.whiten.use]
        found = variance_inflation(self.whiten(remainder), channel)
        inflation = np.ones(len(remainder))
        for one in np.unique(channel):
            inflation[self.measured.channel == one] = found[channel == one][0]
        return replace(self, inflation=inflation)


def independent_noise(measured: Measured, tolerances: Floats) -> NoiseModel:
    """Return a noise model without inflation: all readings count in full."""
    return NoiseModel(measured, tolerances, np.ones(len(measured.value)))
