"""Consistency of measured lengths with a map that is known to some accuracy only.

There are more muscles than joints, so lengths can contradict each other by the map whatever the
joint angles are. With the mean r of the residuals l - f(theta) over a short time, the standard
deviations s of the map's lengths at the posture, and the Jacobian G,

    value = min over d of sum_i (r_i - (G d)_i)^2 / s_i^2

has the chi-squared distribution with m - n degrees of freedom if map and lengths are right. s holds
what the pairs that were learned leave open (`MapPrior.spread`) and what a map cannot follow:
friction and stretch. Noise of the encoders alone, 0.2 mm, is five times smaller. A map's error is
the same for as long as the posture is, so residuals of successive steps count once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import gammaincinv

from jmm_agent.types import Floats

CONTRADICTED = 0.3
"""By how much muscles contradict each other, over the standard deviations of the map's prior [1].

The prior allows for all errors, also those that move joints; few of them contradict. Over actual
robots (seeds 0 to 3) values were at most 1.5 times the upper end from the fourth observation on."""


class Consistency(NamedTuple):
    """Consistency of measured lengths with the map.

    Attributes:
        value: squared contradiction of the lengths over its expectation's unit [1].
        low: lower end of the band in which it lies if the map is right.
        high: upper end of that band.
        consistent: whether it lies in the band.
    """

    value: float
    low: float
    high: float
    consistent: bool


def consistency_of(
    residual: Floats, jacobian: Floats, std: Floats, confidence: float
) -> Consistency | None:
    """Whether residuals are as small as the map is known; None if joints explain any.

    Args:
        residual: measured lengths minus those of the map (m,) [m].
        jacobian: of the lengths (m, n) [m/rad].
        std: standard deviation of each residual (m,) [m]; infinite for one that is in doubt.
        confidence: probability that the value is below the upper end if the map is right; the lower
            end is 0, because lengths that agree too well are no fault.
    """
    known = np.isfinite(std)
    freedom = int(known.sum()) - jacobian.shape[1]
    if freedom < 1:
        return None
    white, arms = residual[known] / std[known], jacobian[known] / std[known, None]
    basis = np.linalg.qr(arms)[0]
    value = float(np.sum((white - basis @ (basis.T @ white)) ** 2))
    high = float(2.0 * gammaincinv(0.5 * freedom, confidence))
    return Consistency(value, 0.0, high, value <= high)
