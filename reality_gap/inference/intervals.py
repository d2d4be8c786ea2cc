"""Confidence intervals of parameters from their profile likelihood.

Where the fit is linear, the profile of the log likelihood along a parameter is a parabola. It is
checked by one replay on either side, at 1.96 standard deviations, with the other parameters moved
along the covariance. The end of the interval is moved to where the parabola through that replay
falls by 1.92, half the 95 % quantile of chi-square; by more where blocks of the log show that the
variance is larger than that by noise (see `reality_gap.inference.posteriors`).
"""

from __future__ import annotations

import numpy as np

from reality_gap.diagnosis import Estimate
from reality_gap.inference.gauss_newton import Fit, Objective, Point
from reality_gap.inference.posteriors import covariance_by_noise, joint_covariance
from reality_gap.inference.problem import Problem
from reality_gap.inference.theta import free_parameters, with_theta
from reality_gap.types import Floats

DROP = 1.92
"""Fall of the log likelihood at the ends of a 95 % interval [nats]."""
WIDE = 1.96
"""Half of a 95 % interval, in standard deviations."""


def intervals(problem: Problem, best: Fit) -> list[dict[str, Estimate]]:
    """Return the parameters of each candidate with 95 % intervals, by name."""
    ends = _ends(problem, best)
    found: list[dict[str, Estimate]] = [{} for _ in best.hypothesis]
    for j, (i, p) in enumerate(free_parameters(best.hypothesis)):
        low, high = sorted(float(np.clip(p.null + e * p.scale, p.low, p.high)) for e in ends[j])
        value = best.hypothesis[i][1][p.name]
        found[i][p.name] = Estimate(value, min(low, value), max(high, value), p.unit)
    return found


def _ends(problem: Problem, best: Fit) -> Floats:
    """Return both ends of the interval of theta, shape (p, 2)."""
    covariance = covariance_by_noise(problem, best)
    variance = np.diag(joint_covariance(problem, best))
    deviation, drop = np.sqrt(variance), DROP * variance / np.diag(covariance)
    ends = np.empty((len(deviation), 2))
    trials = []
    for j in range(len(deviation)):
        along = covariance[:, j] / covariance[j, j]
        for side in (-1.0, 1.0):
            trials.append(best.theta + side * WIDE * deviation[j] * along)
    hypotheses = [with_theta(best.hypothesis, theta) for theta in trials]
    objective = Objective(problem, best.hypothesis)
    base = objective.cost(Point(best.theta, best.residual))
    residuals = problem.replayer.residuals(hypotheses)
    for i, (theta, residual) in enumerate(zip(trials, residuals, strict=True)):
        j, side = divmod(i, 2)
        fall = objective.cost(Point(theta, residual)) - base
        usable = np.isfinite(fall) and fall > 0.1 * drop[j]
        stretch = np.clip(np.sqrt(drop[j] / fall), 0.3, 3.0) if usable else 3.0
        ends[j, side] = best.theta[j] + stretch * (theta[j] - best.theta[j])
    return ends
