"""Refinement: fits of the most promising candidates beside a hypothesis.

Candidates are ranked by their linear evidence. The best are fitted quickly, with the slopes known
from screening. Those that come close to the best are then fitted fully. Where the effect of a
candidate is not linear, other sizes and other initial values are tried, too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from reality_gap.inference.event_times import search_times, times_of
from reality_gap.inference.gauss_newton import (
    Fit,
    Stepwise,
    fit_stepwise,
    rescore,
    resize_stepwise,
    run_together,
)
from reality_gap.inference.problem import Problem
from reality_gap.inference.ranking import Ranked, rank, rank_by_remainder, select_diverse
from reality_gap.inference.screening import Sensitivity
from reality_gap.simulation.hypothesis import Candidate, Hypothesis
from reality_gap.types import Floats

PROMISE = 3.0
"""Linear evidence from which on a further cause is worth a fit [nats]."""
KEPT = 0.5
"""Share of the linearly predicted decrease of the cost that an initial size must reach."""
TWICE = 2.0
"""Size that is tried beside the linear one: with friction, slopes underestimate the size."""
OTHER_SIZES = (4.0, 0.5, 0.2, 0.05)
"""Sizes that are tried if the linear one reaches less, or if twice that size is better."""
NONLINEAR = 20.0
"""Misfit of a quick fit to its linear prediction from which on far starts are tried [nats]."""
FAINT = 0.02
"""Share of the best evidence below which far starts are not tried."""
FAR_FITS = 2
"""How many of the far starts are fitted."""
NEARBY_FITS = 2
"""How many of the nearby values are fitted."""
WORTH = 0.4
"""Share of the best evidence from which on a candidate is fitted fully."""
MORE_STICKY = 5
"""How many more sticky candidates are fitted where one of them explains much."""
MORE_BY_REMAINDER = 3
"""How many more candidates are fitted by what they leave, if a model is wrong by many noises."""
MORE_FAR = 3
"""How many more candidates with far starts are fitted where slopes do not hold."""
MORE_MEMBERS = 4
"""How many elements of a group that explains much are fitted alone."""


def fit_next(
    problem: Problem, sensitivities: Sequence[Sensitivity], base: Fit, refits: int
) -> tuple[Fit, ...]:
    """Fit the most promising candidates beside a hypothesis.

    Args:
        problem: what is to be explained.
        sensitivities: of all candidates.
        base: the causes so far.
        refits: how many candidates to fit.

    Returns:
        Fits of ``base`` with one candidate more each, best first.
    """
    ranked = rank(problem, sensitivities, base)
    blind = base.is_null or problem.noise_model.is_far
    worth = ranked if blind else [one for one in ranked if one.evidence > PROMISE]
    quick = _fit_quickly(problem, select_diverse(worth, refits), base)
    if problem.noise_model.is_far:
        left = rank_by_remainder(problem, sensitivities, base)
        quick += _fit_more(problem, left, MORE_BY_REMAINDER, quick, base, lambda _: True)
    floor = rescore(problem, base).evidence
    leaders = _leaders(quick, floor)
    if any(one.candidate.cause.sticky for one in leaders):
        quick += _fit_more(problem, ranked, MORE_STICKY, quick, base, _is_sticky)
    if any(one.misfit > NONLINEAR for one in leaders):
        quick += _fit_more(problem, ranked, MORE_FAR, quick, base, _has_far_starts)
    groups = [one.candidate for one in leaders if len(one.candidate.location.elements) > 1]
    if groups:
        quick += _fit_more(problem, ranked, MORE_MEMBERS, quick, base, _is_member_of(groups))
    least = floor + FAINT * _most(quick, floor)
    quick = run_together(problem.replayer, [_fit_far(problem, one, least) for one in quick])
    least = floor + WORTH * _most(quick, floor)
    done = run_together(problem.replayer, [_finish(problem, one, least, base) for one in quick])
    return tuple(sorted(done, key=lambda f: -f.evidence))


class _QuickFit(NamedTuple):
    """A fit with slopes from screening.

    Attributes:
        fit: the fit.
        complete: whether slopes in all parameters of the candidate were known.
        misfit: half the squared difference between its residual and the linear prediction [nats].
    """

    fit: Fit
    complete: bool
    misfit: float

    @property
    def candidate(self) -> Candidate:
        """The candidate beside the base."""
        return self.fit.candidates[-1]


def _is_sticky(candidate: Candidate) -> bool:
    return candidate.cause.sticky


def _has_far_starts(candidate: Candidate) -> bool:
    return any(p.hints.far_starts for p in candidate.parameters)


def _is_member_of(groups: Sequence[Candidate]) -> Callable[[Candidate], bool]:
    """Return whether a candidate acts on one element of a group on which its cause acts, too."""

    def is_member(candidate: Candidate) -> bool:
        location = candidate.location
        return len(location.elements) == 1 and any(
            candidate.cause.id == group.cause.id
            and location.kind == group.location.kind
            and location.elements[0] in group.location.elements
            for group in groups
        )

    return is_member


def _most(quick: Sequence[_QuickFit], floor: float) -> float:
    """Return the evidence that the best candidate adds [nats]."""
    return max((one.fit.evidence - floor for one in quick), default=0.0)


def _leaders(quick: Sequence[_QuickFit], floor: float) -> list[_QuickFit]:
    """Return the candidates that explain much, compared with the best."""
    enough = floor + max(PROMISE, WORTH * _most(quick, floor))
    return [one for one in quick if one.fit.evidence > enough]


def _fit_quickly(problem: Problem, chosen: Sequence[Ranked], base: Fit) -> list[_QuickFit]:
    return run_together(problem.replayer, [_quick_fit(problem, one, base) for one in chosen])


def _fit_more(
    problem: Problem,
    ranked: Sequence[Ranked],
    count: int,
    quick: Sequence[_QuickFit],
    base: Fit,
    is_wanted: Callable[[Candidate], bool],
) -> list[_QuickFit]:
    """Fit the best ``count`` candidates that are wanted and not in ``quick`` yet."""
    rest = [
        one
        for one in ranked
        if is_wanted(one.sensitivity.candidate)
        and not any(one.sensitivity.candidate.matches(q.candidate) for q in quick)
    ]
    return _fit_quickly(problem, select_diverse(rest, count, most=count), base)


def _quick_fit(problem: Problem, chosen: Ranked, base: Fit) -> Stepwise[_QuickFit]:
    """Fit a candidate beside ``base`` with known slopes."""
    sensitivity, whiten = chosen.sensitivity, problem.noise_model.whiten
    parameters = sensitivity.candidate.parameters
    start = yield from _start(problem, chosen, base)
    slopes = np.hstack([base.jacobian, _slopes(sensitivity)])
    fitted = yield from fit_stepwise(problem, start, slopes, polish=False)
    change = fitted.theta - np.r_[base.theta, np.zeros(len(parameters))]
    linear = base.residual - slopes @ change
    misfit = 0.5 * float(np.sum(whiten(fitted.residual - linear) ** 2))
    known = {*sensitivity.names, *(p.name for p in parameters if p.hints.shape)}
    return _QuickFit(fitted, len(known) == len(parameters), misfit)


def _fit_far(problem: Problem, quick: _QuickFit, least: float) -> Stepwise[_QuickFit]:
    """Return the fit, or a better one from a far start if slopes do not hold."""
    candidate = quick.candidate
    values = [(p.name, value) for p in candidate.parameters for value in p.hints.far_starts]
    if not values or quick.misfit < NONLINEAR or quick.fit.evidence < least:
        return quick
    base = quick.fit.hypothesis[:-1]
    starts: list[Hypothesis] = [
        [*base, (candidate, candidate.null_values() | {name: value})] for name, value in values
    ]
    residuals = yield starts
    costs = [_cost(problem, residual) for residual in residuals]
    best = quick.fit
    for i in np.argsort(costs)[:FAR_FITS]:
        other = yield from fit_stepwise(problem, starts[i])
        best = max(best, other, key=lambda f: f.evidence)
    return quick._replace(fit=best)


def _finish(problem: Problem, quick: _QuickFit, least: float, base: Fit) -> Stepwise[Fit]:
    """Return the full fit, or the quick one if its evidence is below ``least``."""
    if quick.fit.raw_evidence < least:
        return quick.fit
    if times_of(quick.candidate):
        full = yield from fit_stepwise(problem, quick.fit.hypothesis)
        return (yield from search_times(problem, full, base))
    if quick.complete:
        full = yield from resize_stepwise(problem, quick.fit, len(base.hypothesis))
    else:
        full = yield from fit_stepwise(problem, quick.fit.hypothesis)
    return (yield from _fit_nearby(problem, full))


def _fit_nearby(problem: Problem, old: Fit) -> Stepwise[Fit]:
    """Return the fit, or a better one from nearby values of the last candidate."""
    *rest, (candidate, values) = old.hypothesis
    starts: list[Hypothesis] = [
        [
            *rest,
            (candidate, dict(values) | {p.name: float(np.clip(values[p.name] + d, p.low, p.high))}),
        ]
        for p in candidate.parameters
        for d in p.hints.nearby
    ]
    if not starts:
        return old
    residuals = yield starts
    costs = [_cost(problem, residual) for residual in residuals]
    best = old
    for i in np.argsort(costs)[:NEARBY_FITS]:
        other = yield from fit_stepwise(problem, starts[i])
        best = max(best, other, key=lambda f: f.evidence)
    return best


def _cost(problem: Problem, residual: Floats) -> float:
    """Return half the square of the whitened residual [nats]; infinite if the replay diverged."""
    if not np.all(np.isfinite(residual)):
        return np.inf
    return 0.5 * float(np.sum(problem.noise_model.whiten(residual) ** 2))


def _start(problem: Problem, chosen: Ranked, base: Fit) -> Stepwise[Hypothesis]:
    """Return initial values of a candidate beside ``base``.

    They are those of the linear fit, or of another size where that decreases the cost too little.
    """
    _, sensitivity, theta = chosen
    candidate = sensitivity.candidate

    def beside_base(values: dict[str, float]) -> Hypothesis:
        return [*base.hypothesis, (candidate, values)]

    before = _cost(problem, base.residual)
    promised = before - _cost(problem, base.residual - sensitivity.columns @ theta)
    limit = before - KEPT * promised
    trials = [beside_base(sensitivity.values(size * theta)) for size in (1.0, TWICE)]
    costs = [_cost(problem, residual) for residual in (yield trials)]
    if costs[0] < min(limit, costs[1]):
        return trials[0]
    more = [beside_base(sensitivity.values(size * theta)) for size in OTHER_SIZES]
    for p in candidate.parameters:
        alone = p.hints.starts if len(candidate.parameters) == 1 else ()
        values = sensitivity.fixed | {p.name: p.null}
        more += [beside_base(values | {p.name: x}) for x in (*alone, *p.hints.secants)]
    costs += [_cost(problem, residual) for residual in (yield more)]
    return [*trials, *more][int(np.argmin(costs))]


def _slopes(sensitivity: Sensitivity) -> Floats:
    """Return the columns in the order of the candidate's parameters (n, p); 0 if not screened."""
    parameters = sensitivity.candidate.parameters
    slopes = np.zeros((len(sensitivity.columns), len(parameters)))
    for i, p in enumerate(parameters):
        if p.name in sensitivity.names:
            slopes[:, i] = sensitivity.columns[:, sensitivity.names.index(p.name)]
    return slopes
