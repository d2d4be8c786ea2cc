"""What evidence is measured in: whitening of the splits that are learned from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from reality_gap.inference.gauss_newton import Fit, penalty_scale
from reality_gap.inference.whitening import Whitening, inflation, whitening
from reality_gap.study.measurements import Measured
from reality_gap.study.splits import CHOOSE, FIT, split
from reality_gap.types import Floats


@dataclass(frozen=True)
class NoiseModel:
    """What evidence is measured in.

    Attributes:
        measured: the readings.
        null: (n,) residual of the study's model.
        tolerances: (n, p).
        spread: (n,) how many readings count as one.
    """

    measured: Measured
    null: Floats
    tolerances: Floats
    spread: Floats

    @cached_property
    def learn(self) -> Whitening:
        """Whitening of the fit and choose splits together."""
        return whitening(self.tolerances, self.spread, split(self.measured) <= CHOOSE)

    @cached_property
    def fit(self) -> Whitening:
        """Whitening of the fit split alone."""
        return whitening(self.tolerances, self.spread, split(self.measured) == FIT)

    def where_wanders(self, remainder: Floats) -> NoiseModel:
        """Another, by which readings count for less where ``remainder`` (n,) wanders.

        To be asked of one by which each reading counts as one.
        """
        group = self.measured.channel[self.learn.use]
        found = inflation(self.learn(remainder), group)
        spread = np.ones(len(remainder))
        for channel in np.unique(group):
            spread[self.measured.channel == channel] = found[group == channel][0]
        return replace(self, spread=spread)


def noise_model(measured: Measured, null: Floats, tolerances: Floats) -> NoiseModel:
    """A ruler by which each reading counts as one."""
    return NoiseModel(measured, null, tolerances, np.ones(len(null)))


def predictive(rule: NoiseModel, null: Floats, fitted: Fit) -> float:
    """How much likelier the choose split is than under the null, fitted on the fit split [nats].

    The parameters are moved from their fit on both splits to that on one by a linear step.
    """
    # What one split does not show at all must not run away.
    pull = np.maximum(penalty_scale(fitted.hypothesis), 0.1)
    columns, left = rule.fit(fitted.jacobian), rule.fit(fitted.residual)
    matrix = np.vstack([columns, np.diag(pull)])
    step = np.linalg.lstsq(matrix, np.concatenate([left, -pull * fitted.theta]), rcond=None)[0]
    residual = fitted.residual - fitted.jacobian @ step

    def held_out(r: Floats) -> float:
        return float(np.sum(rule.learn(r) ** 2) - np.sum(rule.fit(r) ** 2))

    return 0.5 * (held_out(null) - held_out(residual))
