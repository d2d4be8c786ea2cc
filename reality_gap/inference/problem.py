"""Problem: what a search for causes starts from, and what its evidence is measured by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from reality_gap.inference.likelihood import NoiseModel
from reality_gap.inference.tolerances import Tolerance
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.measurements import Measured
from reality_gap.study.system import System
from reality_gap.types import Floats


@dataclass(frozen=True)
class Problem:
    """A study whose gap is to be explained.

    Attributes:
        replayer: replays hypotheses of the study.
        null_residual: residual of the nominal model in units of sensor noise, shape (n,).
        noise_model: whitens residuals; evidence depends on it.
        roughness: factor of the tolerances in the noise model.
        tolerances: whose effects are the first columns of the noise model.
        handicaps: evidence that the first cause needs in addition, because the nominal model is
            less likely in the linearisation than in its own; the second one where causes are
            compared by their profile likelihood [nats].
    """

    replayer: Replayer
    null_residual: Floats
    noise_model: NoiseModel
    roughness: float = 1.0
    tolerances: Sequence[Tolerance] = ()
    handicaps: tuple[float, float] = (0.0, 0.0)

    @property
    def system(self) -> System:
        """The study's model and its elements."""
        return self.replayer.system

    @property
    def measured(self) -> Measured:
        """All readings of the study."""
        return self.replayer.measured

    def inflated(self, remainder: Floats) -> Problem:
        """Return the problem with the noise model inflated; see `NoiseModel.inflated`."""
        return replace(self, noise_model=self.noise_model.inflated(remainder))

    def widened(self, remainder: Floats) -> Problem:
        """Return the problem with the variance of a remainder; see `NoiseModel.widened`."""
        return replace(self, noise_model=self.noise_model.widened(remainder))

    @cached_property
    def null_likelihood(self) -> float:
        """Log likelihood of the nominal model with the variance of what it leaves [nats]."""
        null = self.widened(self.null_residual)
        return null.noise_model.log_likelihood(self.null_residual)

    def without_tolerances(self) -> Problem:
        """Return the problem in which tolerances explain nothing, and all channels are alike."""
        none = np.zeros((len(self.null_residual), 0))
        return replace(self, noise_model=replace(self.noise_model, tolerances=none).alike())

    def uninflated(self) -> Problem:
        """Return the problem in which all readings count in full."""
        ones = np.ones(len(self.null_residual))
        return replace(self, noise_model=replace(self.noise_model, inflation=ones, variance=ones))

    def reinflated(self, remainder: Floats) -> Problem:
        """Return the problem with the noise model inflated by this remainder alone."""
        return self.uninflated().inflated(remainder)
