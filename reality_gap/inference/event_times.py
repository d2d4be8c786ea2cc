"""Event times: a search for the times of an event, such as the start and the end of a push, or the
moment in which a tendon becomes longer.

The misfit has local minima over these times, at which Gauss-Newton steps end: a push with a late
end and the right force is better than all its neighbours. Each time therefore has a search of its
own: first several durations, at each of which the other parameters are refitted with their slopes,
then moves of one edge that keep the others. After such a move the size of the event is refitted
along its replayed effect ``e``: with the whitened residual ``r`` without the event, the best size
is ``r'e / e'e``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reality_gap.inference.gauss_newton import Fit, Stepwise, fit_stepwise
from reality_gap.inference.problem import Problem
from reality_gap.inference.theta import is_time, theta_bounds
from reality_gap.simulation.hypothesis import Candidate, Hypothesis
from reality_gap.types import Floats

DURATIONS = (0.4, 2.0, 4.0, 8.0)
"""Durations that are tried first, over the fitted one."""
LATER = 3
"""Number of periods by which an event that repeats may begin later than it was fitted."""
STEPS = (2.0, 1.0, 0.5, 0.25, 0.1)
"""Moves of an edge, in scales of its time, from large to small."""
REPEATS = 6
"""Largest number of successive moves of one size."""
GAIN, SHARE = 0.2, 0.01
"""Smallest decrease of the misfit for which an edge is moved, whichever is less [nats, share].
Where a model is wrong by many noises, few nats are all there are."""
LARGEST = 4.0
"""Largest factor by which the size of the event is changed."""


def times_of(candidate: Candidate) -> list[str]:
    """Return the names of the parameters that are times of an event; none for other candidates."""
    return [p.name for p in candidate.parameters if is_time(p)]


def search_times(problem: Problem, old: Fit, base: Fit) -> Stepwise[Fit]:
    """Return a fit with better times of the last candidate, or the old fit.

    Args:
        problem: what is to be explained.
        old: the fit so far; its last candidate is an event.
        base: the fit without that candidate.
    """
    candidate, values = old.hypothesis[-1]
    timed = times_of(candidate)
    moves = _moves(len(timed))
    whiten, others = problem.noise_model.whiten, old.hypothesis[:-1]
    without = whiten(base.residual)
    best, size, cost = dict(values), 1.0, _left(without, whiten(old.residual))[0]
    first = cost
    for trial in _durations(candidate, best, timed):
        other, left = yield from _refitted(problem, others, candidate, trial, base)
        if left < _improved(cost):
            best, cost = other, left
    if trials := _later(candidate, best, timed):
        other, left, scale = yield from _best_of(problem, others, candidate, trials, without)
        if left < _improved(cost):
            best, cost, size = other, left, scale
    for step in STEPS:
        for _ in range(REPEATS):
            trials = [_moved(candidate, best, timed, step * move) for move in moves]
            other, left, scale = yield from _best_of(problem, others, candidate, trials, without)
            if left > _improved(cost):
                break
            best, cost, size = other, left, scale
    if cost > _improved(first):
        return old
    start: Hypothesis = [*others, (candidate, _resized(candidate, best, timed, size))]
    new = yield from fit_stepwise(problem, start)
    return max(old, new, key=lambda f: f.evidence)


def _durations(
    candidate: Candidate, values: dict[str, float], timed: Sequence[str]
) -> list[dict[str, float]]:
    """Return the values with other durations, each with the same start, middle and end.

    A duration is a time that must be above 0; the event starts at the first time.
    """
    start, found = candidate.parameter(timed[0]), list[dict[str, float]]()
    for p in (candidate.parameter(name) for name in timed[1:]):
        for factor in DURATIONS if p.low > 0.0 and not p.hints.period else ():
            longer = float(np.clip(factor * values[p.name], p.low, p.high))
            for share in (0.0, 0.5, 1.0):
                begin = values[start.name] - share * (longer - values[p.name])
                begin = float(np.clip(begin, start.low, start.high))
                found.append(values | {start.name: begin, p.name: longer})
    return found


def _later(
    candidate: Candidate, values: dict[str, float], timed: Sequence[str]
) -> list[dict[str, float]]:
    """Return the values with starts one or more periods later, if the event repeats."""
    start = candidate.parameter(timed[0])
    periods = [values[name] for name in timed if candidate.parameter(name).hints.period]
    later = [values[start.name] + k * period for period in periods for k in range(1, LATER + 1)]
    return [values | {start.name: time} for time in later if time <= start.high]


def _best_of(
    problem: Problem,
    others: Hypothesis,
    candidate: Candidate,
    trials: Sequence[dict[str, float]],
    without: Floats,
) -> Stepwise[tuple[dict[str, float], float, float]]:
    """Return the best of some values, the misfit that is left at its best size, and that size."""
    hypotheses: list[Hypothesis] = [[*others, (candidate, trial)] for trial in trials]
    residuals = yield hypotheses
    found = [
        _left(without, problem.noise_model.whiten(r)) if np.all(np.isfinite(r)) else (np.inf, 1.0)
        for r in residuals
    ]
    k = int(np.argmin([left for left, _ in found]))
    return trials[k], *found[k]


def _refitted(
    problem: Problem,
    others: Hypothesis,
    candidate: Candidate,
    values: dict[str, float],
    base: Fit,
) -> Stepwise[tuple[dict[str, float], float]]:
    """Return the values with refitted sizes, and the misfit that is left by slopes [nats]."""
    whiten, without = problem.noise_model.whiten, problem.noise_model.whiten(base.residual)
    free = [p for p in candidate.parameters if not p.hints.starts]
    nulls = values | {p.name: p.null for p in free}
    trials: list[Hypothesis] = [
        [*others, (candidate, nulls | {p.name: p.null + p.scale})] for p in free
    ]
    residuals = yield trials
    columns = np.column_stack([without - whiten(np.nan_to_num(r)) for r in residuals])
    low, high = theta_bounds(free)
    theta = np.clip(np.linalg.lstsq(columns, without, rcond=None)[0], low, high)
    found = {p.name: float(p.null + x * p.scale) for p, x in zip(free, theta, strict=True)}
    return values | found, 0.5 * float(np.sum((without - columns @ theta) ** 2))


def _moves(times: int) -> list[Floats]:
    """Return the moves of edges: each time alone, and pairs of which one makes up for the other.

    With a start and a duration, these are the end, the whole event, and the start alone.
    """
    unit = np.eye(times)
    pairs = [unit[i] - unit[j] for i in range(times) for j in range(i)]
    return [sign * move for move in (*unit, *pairs) for sign in (1.0, -1.0)]


def _moved(
    candidate: Candidate, values: dict[str, float], timed: Sequence[str], move: Floats
) -> dict[str, float]:
    """Return the values with moved times, which are clipped to their bounds."""
    found = dict(values)
    for name, scales in zip(timed, move, strict=True):
        p = candidate.parameter(name)
        found[name] = float(np.clip(found[name] + scales * p.scale, p.low, p.high))
    return found


def _resized(
    candidate: Candidate, values: dict[str, float], timed: Sequence[str], size: float
) -> dict[str, float]:
    """Return the values with the parameters other than times multiplied by a size."""
    found = dict(values)
    for p in candidate.parameters:
        if p.name not in timed:
            found[p.name] = float(np.clip(p.null + size * (found[p.name] - p.null), p.low, p.high))
    return found


def _improved(cost: float) -> float:
    """Return the misfit below which a change of times is an improvement [nats]."""
    return cost - min(GAIN, SHARE * cost)


def _left(without: Floats, residual: Floats) -> tuple[float, float]:
    """Return the misfit that an event leaves at its best size [nats], and that size."""
    effect = without - residual
    power = float(effect @ effect)
    size = float(np.clip(without @ effect / power, 0.0, LARGEST)) if power > 0.0 else 0.0
    return 0.5 * float(np.sum((without - size * effect) ** 2)), size
