"""Settling: fits of models that are wrong by many noises, which depend on what they leave."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reality_gap.inference.gauss_newton import Fit, fit_stepwise, profile, rescore, run_together
from reality_gap.inference.problem import Problem
from reality_gap.types import Floats

SETTLINGS = 3
"""Largest number of times that fits are repeated where a model is wrong by many noises."""
SETTLED = 6
"""How many fits are repeated."""
STABLE = 0.9
"""Mean square, in units of the variance before, from which on another fit changes little."""


def settle(plain: Problem, tried: Sequence[Fit]) -> tuple[Problem, tuple[Fit, ...]]:
    """Return the problem inflated by what the best of some fits leaves, and all fits, best first.

    Where a model is wrong by many noises, the more a fit leaves, the nearer to the null a prior
    holds it. Each is therefore repeated with the variance of what it leaves itself.
    """
    problem = plain.inflated(tried[0].residual)
    tried = rescored(problem, tried)
    if not problem.noise_model.is_far:
        return problem, tried
    first, rest = tried[:SETTLED], tried[SETTLED:]
    for _ in range(SETTLINGS):
        own = [problem.widened(f.residual) for f in first]
        pairs = zip(own, first, strict=True)
        fits = [fit_stepwise(one, f.hypothesis, f.jacobian) for one, f in pairs]
        again = run_together(problem.replayer, fits)
        powers = [whitened_power(one, f.residual) for one, f in zip(own, again, strict=True)]
        first = tuple(again)
        if min(powers) > STABLE:
            break
    ordered = sorted((profile(problem, f) for f in (*first, *rest)), key=lambda f: -f.evidence)
    return plain.inflated(ordered[0].residual), tuple(ordered)


def rescored(problem: Problem, fits: Sequence[Fit]) -> tuple[Fit, ...]:
    """Return fits with the evidence that a problem's noise model gives them, best first."""
    return tuple(sorted((rescore(problem, f) for f in fits), key=lambda f: -f.evidence))


def whitened_power(problem: Problem, residual: Floats) -> float:
    """Return the mean square of a whitened residual."""
    return float(np.mean(problem.noise_model.whiten(residual) ** 2))
