"""What evidence is measured in: whitening of the splits that are learned from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reality_gap.fitting import Fit, penalty_scale
from reality_gap.measured import Measured
from reality_gap.splits import CHOOSE, FIT, split
from reality_gap.whitening import Whitening, inflation, whitening

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Ruler:
    """What evidence is measured in.

    Attributes:
        learn: whitening of the fit and choose splits together.
        fit: of the fit split alone.
        null: (n,) residual of the study's model.
        tolerances: (n, p).
    """

    learn: Whitening
    fit: Whitening
    null: Array
    tolerances: Array


def ruler(measured: Measured, null: Array, tolerances: Array, remainder: Array | None) -> Ruler:
    """Make a ruler; readings count for less where ``remainder`` (n,) wanders."""
    role = split(measured)
    ones = np.ones(len(null))
    learn = whitening(tolerances, ones, role <= CHOOSE)
    spread = ones
    if remainder is not None:
        group = measured.channel[learn.use]
        spread = np.ones(len(null))
        found = inflation(learn(remainder), group)
        for channel in np.unique(group):
            spread[measured.channel == channel] = found[group == channel][0]
        learn = whitening(tolerances, spread, role <= CHOOSE)
    return Ruler(learn, whitening(tolerances, spread, role == FIT), null, tolerances)


def predictive(rule: Ruler, null: Array, fitted: Fit) -> float:
    """How much likelier the choose split is than under the null, fitted on the fit split [nats].

    The parameters are moved from their fit on both splits to that on one by a linear step.
    """
    # What one split does not show at all must not run away.
    pull = np.maximum(penalty_scale(fitted.hypothesis), 0.1)
    columns, left = rule.fit(fitted.jacobian), rule.fit(fitted.residual)
    matrix = np.vstack([columns, np.diag(pull)])
    step = np.linalg.lstsq(matrix, np.concatenate([left, -pull * fitted.theta]), rcond=None)[0]
    residual = fitted.residual - fitted.jacobian @ step

    def held_out(r: Array) -> float:
        return float(np.sum(rule.learn(r) ** 2) - np.sum(rule.fit(r) ** 2))

    return 0.5 * (held_out(null) - held_out(residual))
