"""Settling: fits of models that are wrong by many noises, which depend on what they leave."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from reality_gap.inference.gauss_newton import (
    Fit,
    fit,
    fit_stepwise,
    profile,
    rescore,
    run_together,
)
from reality_gap.inference.problem import Problem
from reality_gap.inference.theta import is_tolerable
from reality_gap.types import Floats

SETTLINGS = 3
"""Largest number of times that fits are repeated where a model is wrong by many noises."""
SETTLED = 6
"""How many fits are repeated."""
STABLE = 0.9
"""Share of the variance before that is left, from which on another fit changes little."""


class Settled(NamedTuple):
    """Fits of one step of a search.

    Attributes:
        problem: the problem, inflated by what the best fit leaves.
        tried: the fits, best first: by their evidence, or by their profile likelihood.
        base: the fit without the last candidates, with an evidence of the same kind.
        profiled: whether they were compared by their profile likelihood.
    """

    problem: Problem
    tried: tuple[Fit, ...]
    base: Fit
    profiled: bool


def settle(plain: Problem, tried: Sequence[Fit], base: Fit) -> Settled:
    """Compare fits by what the best of them leaves.

    Where a model is wrong by many noises, the more a fit leaves, the nearer to the null a prior
    holds it. Each is therefore repeated with the variance of what it leaves itself, as in a
    least-squares fit of unknown variance. Tolerances have no part in this: what they explain is
    small beside such errors, and along their directions other causes would go unnoticed.

    Args:
        plain: the problem without inflation.
        tried: fits of ``base`` with one candidate more each, best first.
        base: the causes so far.
    """
    problem = plain.inflated(tried[0].residual)
    if not problem.noise_model.is_far:
        return Settled(problem, rescored(problem, tried), rescore(problem, base), False)
    bare = problem.without_tolerances()
    tried = tuple(sorted(tried, key=lambda f: -profile(bare, f).evidence))
    first, rest = tried[:SETTLED], tried[SETTLED:]
    own = [bare.widened(f.residual) for f in first]
    for _ in range(SETTLINGS):
        before = own
        pairs = zip(own, first, strict=True)
        fits = [fit_stepwise(one, f.hypothesis, f.jacobian) for one, f in pairs]
        first = tuple(run_together(problem.replayer, fits))
        own = [bare.widened(f.residual) for f in first]
        left = [[variance_left(one) for one in some] for some in (before, own)]
        if all(new > STABLE * old for old, new in zip(*left, strict=True)):
            break
    first = _without_needless(own, first)
    ordered = sorted((profile(bare, f) for f in (*first, *rest)), key=lambda f: -f.evidence)
    best = plain.inflated(ordered[0].residual)
    return Settled(best, tuple(ordered), profile(bare, base), True)


def _without_needless(problems: Sequence[Problem], fits: Sequence[Fit]) -> tuple[Fit, ...]:
    """Return fits of two causes without the first one where the second makes it needless.

    The first cause may be chosen because slopes at the null do not lead to the right one. Beside
    that one, it is within its tolerance, and no cause.

    Args:
        problems: what each of them explains.
        fits: the fits.
    """
    found = []
    for problem, one in zip(problems, fits, strict=True):
        *first, last = one.hypothesis
        needless = len(first) == 1 and is_tolerable(*first[0]) and not is_tolerable(*last)
        found.append(fit(problem, [last]) if needless else one)
    return tuple(found)


def variance_left(problem: Problem) -> float:
    """Return the mean variance of what neither causes nor tolerances explain [noise^2].

    Args:
        problem: widened by what the causes leave.
    """
    return float(np.mean(problem.noise_model.variance))


def rescored(problem: Problem, fits: Sequence[Fit]) -> tuple[Fit, ...]:
    """Return fits with the evidence that a problem's noise model gives them, best first."""
    return tuple(sorted((rescore(problem, f) for f in fits), key=lambda f: -f.evidence))


def whitened_power(problem: Problem, residual: Floats) -> float:
    """Return the mean square of a whitened residual."""
    return float(np.mean(problem.noise_model.whiten(residual) ** 2))
