"""Waterfall: what tolerances and causes take one after the other from the error of held-out data.

The part of the error that tolerances explain is inferred beside all causes, from the fit and
selection splits, and taken away first: a faint cause shows only after that. Then the causes are
added one by one, each with all parameters fitted again.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reality_gap.diagnosis import Share
from reality_gap.inference.forward_selection import Search
from reality_gap.inference.gauss_newton import Fit, fit
from reality_gap.inference.hidden_edges import with_hidden_edges
from reality_gap.inference.paying import Tested
from reality_gap.inference.whitening import explained_by_tolerances
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.study.splits import REPORT, split
from reality_gap.types import Floats

TOLERANCES = "small deviations within the tolerances"
"""What the first step of a waterfall is called."""


def waterfall(
    result: Search, tested: Tested, order: Sequence[Candidate], before: float, floor: float
) -> tuple[Share, ...]:
    """Return the steps of the waterfall of the best causes.

    Args:
        result: the search.
        tested: the test of its best causes.
        order: these causes in the order in which they are added.
        before: RMS of the residual of the nominal model on the report split [noise].
        floor: RMS of the readings' own noise there [noise].
    """
    problem, best = result.problem, result.best
    report = split(problem.measured) == REPORT
    model = problem.noise_model
    within = explained_by_tolerances(model.tolerances, model.inflation, ~report, best.residual)

    def rms(residual: Floats) -> float:
        return float(np.sqrt(np.mean(residual[report] ** 2)))

    null = problem.null_residual
    names = [TOLERANCES, *(f"{one.cause.title} at {one.location}" for one in order)]
    sizes = [before, rms(null - within)]
    for i in range(1, len(order) + 1):
        sizes.append(rms(_subset(result, tested, order[:i]).residual - within))
    return shares(names, sizes, floor)


def shares(names: Sequence[str], sizes: Sequence[float], floor: float) -> tuple[Share, ...]:
    """Return the steps of a waterfall.

    Args:
        names: name of each step.
        sizes: RMS before the first step and after each of them [noise].
        floor: RMS of the noise [noise].
    """
    whole = max(sizes[0] ** 2 - floor**2, sizes[0] ** 2 - min(sizes) ** 2, 1e-12)
    return tuple(
        Share(name, before, after, (before**2 - after**2) / whole)
        for name, before, after in zip(names, sizes[:-1], sizes[1:], strict=True)
    )


def _subset(result: Search, tested: Tested, chosen: Sequence[Candidate]) -> Fit:
    """Return the fit of some of the best causes."""
    best = result.best
    if len(chosen) == len(best.hypothesis):
        return best
    for one in tested.without:
        if len(one.hypothesis) == len(chosen) and all(_holds(one, other) for other in chosen):
            return one
    rest = [part for part in best.hypothesis if any(part[0].matches(one) for one in chosen)]
    step = result.step_beside(rest)
    found = step.base if step is not None else fit(result.problem, rest)
    return with_hidden_edges(result.problem, found)


def _holds(fitted: Fit, candidate: Candidate) -> bool:
    return any(candidate.matches(one) for one in fitted.candidates)
