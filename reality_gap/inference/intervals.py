"""Intervals of parameters from their profile likelihood."""

from __future__ import annotations

import numpy as np

from reality_gap.diagnosis import Estimate
from reality_gap.inference.gauss_newton import Fit, at, free_parameters, penalty_scale
from reality_gap.inference.whitening import Whitening
from reality_gap.simulation.replayer import Replayer
from reality_gap.types import Floats

DROP = 1.92
"""Fall of the log likelihood at the ends of a 95 % interval: half the chi-square quantile."""
WIDE = 1.96


def intervals(replayer: Replayer, best: Fit, white: Whitening) -> list[dict[str, Estimate]]:
    """Each suspect's parameters with 95 % intervals.

    The likelihood's profile is a parabola where the fit is linear. It is checked by one replay on
    either side, at 1.96 standard deviations with the other parameters following, and the end is
    moved to where a parabola through that replay falls by 1.92.
    """
    pull = penalty_scale(best.hypothesis)
    columns = white(best.jacobian)
    information = columns.T @ columns + np.diag(pull**2) + 1e-12 * np.eye(len(pull))
    covariance = np.linalg.inv(information)
    deviation = np.sqrt(np.diag(covariance))
    ends = np.empty((len(pull), 2))
    trials = []
    for j in range(len(pull)):
        along = covariance[:, j] / covariance[j, j]
        for side in (-1.0, 1.0):
            trials.append(best.theta + side * WIDE * deviation[j] * along)
    residuals = replayer.residuals([at(best.hypothesis, theta) for theta in trials])
    base = _cost(white, best.residual, pull, best.theta)
    for i, (theta, residual) in enumerate(zip(trials, residuals, strict=True)):
        j, side = divmod(i, 2)
        fall = _cost(white, residual, pull, theta) - base
        usable = np.isfinite(fall) and fall > 0.1 * DROP
        stretch = np.clip(np.sqrt(DROP / fall), 0.3, 3.0) if usable else 3.0
        ends[j, side] = best.theta[j] + stretch * (theta[j] - best.theta[j])
    found: list[dict[str, Estimate]] = [{} for _ in best.hypothesis]
    for j, (i, p) in enumerate(free_parameters(best.hypothesis)):
        low, high = sorted(float(np.clip(p.null + e * p.scale, p.low, p.high)) for e in ends[j])
        value = best.hypothesis[i][1][p.name]
        found[i][p.name] = Estimate(value, min(low, value), max(high, value), p.unit)
    return found


def _cost(white: Whitening, residual: Floats, pull: Floats, theta: Floats) -> float:
    return 0.5 * float(np.sum(white(residual) ** 2) + np.sum((pull * theta) ** 2))
