"""Who may stand beside a hypothesis: quick fits of many newcomers, full ones of the likeliest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from reality_gap.inference.gauss_newton import (
    Asking,
    Fit,
    fitting,
    log_evidence,
    resizing,
    together,
)
from reality_gap.inference.likelihood import NoiseModel
from reality_gap.inference.ranking import Ranked, diverse, rank
from reality_gap.inference.screening import Sensitivity
from reality_gap.simulation.hypothesis import Candidate, same
from reality_gap.simulation.replayer import Hypothesis, Replayer
from reality_gap.types import Floats

PROMISE = 3.0
"""Linear evidence that makes a further cause worth a fit [nats]."""
KEPT = 0.5
"""Share of what a line through small faults promises that a start must keep."""
TWICE = 2.0
"""The size that is tried beside it: what sticks may be far larger than its slope tells."""
OTHER_SIZES = (4.0, 0.5, 0.2, 0.05)
"""Sizes that are tried if it keeps less, or if twice is better."""
BENT = 20.0
"""What lines through small faults may miss of a quick fit before it is begun from afar [nats]."""
FAINT = 0.02
"""Share of the best evidence from which on this is done."""
FEW = 2
"""How many of the starts from afar are fitted."""
WORTH = 0.4
"""Share of the best evidence from which on other sizes of a suspect are tried."""
MORE_STICKY = 5
"""How many more of what sticks are fitted where one of it explains much."""
MORE_AFAR = 3
"""How many more that can be begun from afar are fitted where lines do not hold."""


def again(rule: NoiseModel, old: Fit) -> Fit:
    """The same fit, its evidence measured by another ruler."""
    found = log_evidence(
        rule.learn, rule.null, old.residual, old.jacobian, old.theta, old.hypothesis
    )
    return replace(old, evidence=found)


def try_next(
    replayer: Replayer,
    found: Sequence[Sensitivity],
    rule: NoiseModel,
    base: Fit | None,
    refits: int,
) -> tuple[Fit, ...]:
    """Fit the most promising suspects beside ``base``, best first."""
    ranked = rank(found, rule, base)
    worth = ranked if base is None else [item for item in ranked if item[0] > PROMISE]
    chosen = diverse(worth, refits)
    quick = together(replayer, [_attempt(*one, rule, base) for one in chosen])
    floor = 0.0 if base is None else again(rule, base).evidence
    leaders = _leaders(quick, floor)
    if any(one.candidate.cause.sticky for one in leaders):
        rest = [item for item in ranked if item[1].candidate.cause.sticky]
        quick += _try_more(replayer, rest, MORE_STICKY, quick, rule, base)
    if any(one.bent > BENT for one in leaders):
        rest = [
            item for item in ranked if any(p.hints.far_starts for p in item[1].candidate.parameters)
        ]
        quick += _try_more(replayer, rest, MORE_AFAR, quick, rule, base)
    seen = floor + FAINT * _more(quick, floor)
    quick = together(replayer, [_from_afar(one, rule, seen) for one in quick])
    close = floor + WORTH * _more(quick, floor)
    first = 0 if base is None else len(base.hypothesis)
    done = together(replayer, [_finish(one, rule, close, first) for one in quick])
    return tuple(sorted(done, key=lambda f: -f.evidence))


class _Quick(NamedTuple):
    """A quick fit with slopes known from the null or the base.

    ``whole``: these are slopes in all parameters; ``bent``: what they miss of its residual [nats].
    """

    fit: Fit
    whole: bool
    bent: float

    @property
    def candidate(self) -> Candidate:
        """The newcomer."""
        return self.fit.candidates[-1]


def _more(quick: Sequence[_Quick], floor: float) -> float:
    """What the best adds to what the base explains [nats]."""
    return max((one.fit.evidence - floor for one in quick), default=0.0)


def _leaders(quick: Sequence[_Quick], floor: float) -> list[_Quick]:
    """Those that explain much, beside the best."""
    enough = floor + max(PROMISE, WORTH * _more(quick, floor))
    return [one for one in quick if one.fit.evidence > enough]


def _try_more(
    replayer: Replayer,
    ranked: Ranked,
    count: int,
    quick: Sequence[_Quick],
    rule: NoiseModel,
    base: Fit | None,
) -> list[_Quick]:
    """Quick fits of some more of the ranked, who are not in ``quick``."""
    rest = [item for item in ranked if not any(same(item[1].candidate, q.candidate) for q in quick)]
    more = diverse(rest, count, most=count)
    return together(replayer, [_attempt(*one, rule, base) for one in more])


def _attempt(
    sensitivity: Sensitivity, theta: Floats, rule: NoiseModel, base: Fit | None
) -> Asking[_Quick]:
    """A quick fit."""
    start = yield from _start(sensitivity, theta, rule, base)
    known, moved_from = _slopes(sensitivity), np.zeros(len(sensitivity.candidate.parameters))
    begin = rule.null
    if base is not None:
        known, moved_from = np.hstack([base.jacobian, known]), np.r_[base.theta, moved_from]
        begin = base.residual
    fitted = yield from fitting(start, rule.learn, rule.null, known, polish=False)
    line = begin - known @ (fitted.theta - moved_from)
    bent = 0.5 * float(np.sum(rule.learn(fitted.residual - line) ** 2))
    whole = len(sensitivity.names) == len(sensitivity.candidate.parameters)
    return _Quick(fitted, whole, bent)


def _from_afar(quick: _Quick, rule: NoiseModel, least: float) -> Asking[_Quick]:
    """The same, or a better fit from one of the newcomer's other starts, where lines are bent."""
    candidate = quick.candidate
    values = [(p.name, value) for p in candidate.parameters for value in p.hints.far_starts]
    if not values or quick.bent < BENT or quick.fit.evidence < least:
        return quick
    others = quick.fit.hypothesis[:-1]
    starts: list[Hypothesis] = [
        [*others, (candidate, candidate.nulls() | {name: value})] for name, value in values
    ]
    found = yield starts
    costs = [_cost(rule, residual) for residual in found]
    best = quick.fit
    for i in np.argsort(costs)[:FEW]:
        another = yield from fitting(starts[i], rule.learn, rule.null)
        best = max(best, another, key=lambda f: f.evidence)
    return quick._replace(fit=best)


def _finish(quick: _Quick, rule: NoiseModel, close: float, first: int) -> Asking[Fit]:
    """The full fit of whoever is ``close`` to the best."""
    if quick.fit.evidence < close:
        return quick.fit
    if quick.whole:
        return (yield from resizing(quick.fit, rule.learn, rule.null, first))
    return (yield from fitting(quick.fit.hypothesis, rule.learn, rule.null))


def _cost(rule: NoiseModel, residual: Floats) -> float:
    """Half the whitened square [nats]; infinite where a replay diverged."""
    diverged = not np.all(np.isfinite(residual))
    return np.inf if diverged else 0.5 * float(np.sum(rule.learn(residual) ** 2))


def _start(
    sensitivity: Sensitivity, theta: Floats, rule: NoiseModel, base: Fit | None
) -> Asking[Hypothesis]:
    """A suspect beside ``base`` at ``theta``, or of another size where lines promise too much."""
    known = tuple(base.hypothesis) if base else ()
    residual = base.residual if base else rule.null

    def of_size(size: float) -> Hypothesis:
        return [*known, (sensitivity.candidate, sensitivity.values(size * theta))]

    before = _cost(rule, residual)
    promise = before - _cost(rule, residual - sensitivity.columns @ theta)
    first, least = [of_size(1.0), of_size(TWICE)], before - KEPT * promise
    costs = [_cost(rule, r) for r in (yield first)]
    if costs[0] < min(least, costs[1]):
        return first[0]
    trials = [of_size(size) for size in OTHER_SIZES]
    if len(sensitivity.candidate.parameters) == 1:
        lone = sensitivity.candidate.parameters[0]
        others = (*lone.hints.starts, *lone.hints.secants)
        trials += [[*known, (sensitivity.candidate, {lone.name: x})] for x in others]
    costs += [_cost(rule, r) for r in (yield trials)]
    return [*first, *trials][int(np.argmin(costs))]


def _slopes(sensitivity: Sensitivity) -> Floats:
    """The columns in the order of the suspect's parameters; 0 where none was looked at."""
    slopes = np.zeros((len(sensitivity.columns), len(sensitivity.candidate.parameters)))
    for i, p in enumerate(sensitivity.candidate.parameters):
        if p.name in sensitivity.names:
            slopes[:, i] = sensitivity.columns[:, sensitivity.names.index(p.name)]
    return slopes
