"""Paying causes: those that predict held-out readings better, jointly and each beside the others.

Evidence assumes that one of the candidates has exactly the right form, and pays for anything where
none has. Each cause of the final set is therefore tested on readings that its parameters were not
fitted to: the set must predict them better than the set without the cause, fitted again, and than
the nominal model. In cross-validation over all folds, the 95 % interval of the gain must lie above
zero; on the report split, which had no part in the choice of the cause either, the gain must be
positive unless a short event lies between two of its blocks, and the RMS of the residual must not
surely grow. The cause that fails most is dropped, until all of the rest pay. A cause with a
parameter at its bound is dropped before, and one in whose place a stop explains more: the fit shows
that it stands for another one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from reality_gap.diagnosis import Criterion, Estimate, Gain
from reality_gap.inference.deviations import deviations
from reality_gap.inference.folds import Folds
from reality_gap.inference.forward_selection import SWAP, Search
from reality_gap.inference.gauss_newton import Fit, fit, null_fit, rescore
from reality_gap.inference.held_out import is_shown, score
from reality_gap.inference.hidden_edges import with_hidden_edges
from reality_gap.simulation.hypothesis import Candidate, Hypothesis, Part

NEAR = 0.01
"""Distance of a parameter from its bound, relative to that of the bound from the null value, below
which the parameter counts as at its bound."""
AT_BOUND = "has a parameter at its bound"
UNLIKELY = "is too unlikely beside other explanations"
NO_GAIN = "does not surely predict better the readings that were not used to find it"


class Gains(NamedTuple):
    """What causes gain on held-out readings.

    Attributes:
        folds: gain in log likelihood of all folds, each predicted from the others [nats].
        report: gain in log likelihood of the report split [nats].
        is_shown: whether the report split has a part in what the causes change. A short event may
            lie between two of its blocks.
    """

    folds: Gain
    report: Gain
    is_shown: bool = True

    @property
    def pays_in_report(self) -> bool:
        """Whether the gain of the report split is above zero, if it shows the causes."""
        return self.report.value > 0.0 or not self.is_shown

    @property
    def pays(self) -> bool:
        """Whether the gain of all folds is surely above zero, and that of the report split is."""
        return self.folds.low > 0.0 and self.pays_in_report


@dataclass(frozen=True)
class Tested:
    """Test of causes on held-out readings.

    Attributes:
        total: gains over the nominal model.
        each: gains over the other causes alone, fitted again, by cause.
        without: these fits of the other causes.
        improvement: decrease of the RMS of the residual on the report split, beyond the
            deviations that are within tolerances; see `Deviations` [noise].
    """

    total: Gains
    each: tuple[Gains, ...]
    without: tuple[Fit, ...]
    improvement: Gain

    @property
    def pays(self) -> bool:
        """Whether all causes together predict held-out readings better than the nominal model."""
        return self.total.pays and self.improvement.high > 0.0


class Dropped(NamedTuple):
    """A cause that was dropped.

    Attributes:
        candidate: the cause and its location.
        values: its parameters in SI units.
        gains: its gains over the other causes of that time.
        reason: why it was dropped, as the end of a sentence.
    """

    candidate: Candidate
    values: Mapping[str, float]
    gains: Gains
    reason: str


@dataclass(frozen=True)
class Paying:
    """The causes of a search that pay.

    Attributes:
        result: the search, whose best hypothesis has these causes only.
        tested: their test.
        attempt: the best hypothesis before causes were dropped.
        attempted: the test of that hypothesis.
        dropped: the causes that were dropped, in this order.
    """

    result: Search
    tested: Tested
    attempt: Fit
    attempted: Tested
    dropped: tuple[Dropped, ...] = ()


def keep_paying(result: Search) -> Paying:
    """Drop the causes of a search that do not pay.

    Args:
        result: a search.
    """
    result = replace(result, best=with_hidden_edges(result.problem, result.best))
    tested = held_out_test(result)
    return _keep_paying(Paying(result, tested, result.best, tested))


def without_cause(paying: Paying, i: int, reason: str) -> Paying:
    """Drop a cause that pays, and those that do not pay without it.

    None takes its place, for all others are less likely; where that makes another cause needless,
    `keep_paying` says what takes its place.

    Args:
        paying: causes that pay.
        i: index of the cause.
        reason: why it is dropped, as the end of a sentence.
    """
    left, result = paying.tested.without[i], paying.result
    if left.is_null:  # the gap itself does not inflate the noise
        return _with_dropped(paying, i, reason, replace(result, best=left))
    problem = result.problem.reinflated(left.residual)
    result = replace(result, problem=problem, best=rescore(problem, left))
    return _keep_paying(_with_dropped(paying, i, reason, result))


def _keep_paying(paying: Paying) -> Paying:
    """Drop causes until all others pay."""
    while not paying.result.best.is_null:
        worst = _worst(paying.result, paying.tested)
        if worst is None:
            break
        i, reason = worst
        dropped = [one.candidate for one in paying.dropped]
        dropped.append(paying.result.best.candidates[i])
        result = _reduced(paying.result, paying.tested.without[i], dropped)
        paying = _with_dropped(paying, i, reason, result)
    return paying


def _with_dropped(paying: Paying, i: int, reason: str, result: Search) -> Paying:
    """Return the causes that ``result`` has in place of those with cause ``i``, with their test."""
    candidate, values = paying.result.best.hypothesis[i]
    dropped = Dropped(candidate, dict(values), paying.tested.each[i], reason)
    tested = held_out_test(result)
    return replace(paying, result=result, tested=tested, dropped=(*paying.dropped, dropped))


def held_out_test(result: Search) -> Tested:
    """Test the best causes of a search on held-out readings."""
    problem, best = result.problem, result.best
    folds, null = Folds(problem, best), null_fit(problem)
    # An edge that only the best fit has where it is would be credited to each other cause.
    without = tuple(
        with_hidden_edges(problem, _without(result, i)) for i in range(len(best.hypothesis))
    )

    def gains(one: Fit) -> Gains:
        shown = is_shown(problem.measured, one.residual - best.residual)
        return Gains(folds.cross_validated(one), folds.report(one), shown)

    # Deviations may have hidden a part of what a cause adds; without it they cost more.
    before, after = (
        one.left_with_cost for one in deviations(problem, null.residual, best.residual)
    )
    scored = score(problem.system.study, problem.measured, before, after)
    each = tuple(gains(one) for one in without)
    total = each[0] if len(each) == 1 else gains(null)
    return Tested(total, each, without, scored.improvement)


def beside_dropped(
    estimates: Sequence[dict[str, Estimate]], paying: Paying
) -> list[dict[str, Estimate]]:
    """Return estimates of the causes whose intervals also hold their values beside dropped causes.

    A cause that was dropped although it predicts better stands for something that acts on the
    machine and has no name. Without it, the others bear its part.

    Args:
        estimates: the parameters of each cause, by name.
        paying: the causes.
    """
    if not any(one.gains.pays for one in paying.dropped):
        return list(estimates)
    found = list[dict[str, Estimate]]()
    for candidate, own in zip(paying.result.best.candidates, estimates, strict=True):
        beside = next((v for c, v in paying.attempt.hypothesis if c.matches(candidate)), {})
        found.append({n: _with(one, beside.get(n, one.value)) for n, one in own.items()})
    return found


def _with(estimate: Estimate, value: float) -> Estimate:
    low, high = min(estimate.low, value), max(estimate.high, value)
    return replace(estimate, low=low, high=high)


def held_out_criteria(paying: Paying) -> tuple[Criterion, ...]:
    """Return the criteria by which causes were kept or dropped."""
    kept = zip(paying.result.best.hypothesis, paying.tested.each, strict=True)
    all_parts: list[tuple[Part, Gains]] = [
        *kept,
        *(((one.candidate, one.values), one.gains) for one in paying.dropped),
    ]
    found = list[Criterion]()
    for part, gains in all_parts:
        low, value, near = gains.folds.low, gains.report.value, distance_to_bound(part)
        found += [
            Criterion(f"folds_gain_low: {part[0]}", low, 0.0, low > 0.0, NO_GAIN),
            Criterion(f"report_gain: {part[0]}", value, 0.0, gains.pays_in_report, NO_GAIN),
            Criterion(f"distance_to_bound: {part[0]}", near, NEAR, near > NEAR, AT_BOUND),
        ]
    if all_parts:
        tested = paying.attempted if paying.result.best.is_null else paying.tested
        high = tested.improvement.high
        found.append(Criterion("rms_gain_high", high, 0.0, high > 0.0, NO_GAIN))
    return tuple(found)


def at_bound(hypothesis: Hypothesis) -> bool:
    """Return whether a parameter is at its bound, which shows that the cause is another one."""
    return any(distance_to_bound(part) <= NEAR for part in hypothesis)


def distance_to_bound(part: Part) -> float:
    """Return the least distance of a parameter from a bound, as a share of that of the null value.

    It is 1 without bounds, for parameters at their null values, and for most shapes: their ends say
    "hardly" and "very", and not that the cause is another one. Nor does the absence of a property.
    """
    candidate, values = part
    return min(
        (
            min(1.0, abs(values[p.name] - bound) / abs(bound - p.null))
            for p in candidate.parameters
            if p.hints.bounded or not p.hints.shape
            for bound in ((p.high,) if p.hints.absence else (p.low, p.high))
            if bound != p.null and np.isfinite(bound)
        ),
        default=1.0,
    )


def _worst(result: Search, tested: Tested) -> tuple[int, str] | None:
    """Return the index of the cause to drop, and why; None if all of them pay."""
    best, stop = result.best, result.stop
    if stop is not None and stop.cause in best.candidates:
        return best.candidates.index(stop.cause), stop.objection
    lows = [
        min(gains.folds.low, gains.report.value) if gains.is_shown else gains.folds.low
        for gains in tested.each
    ]
    bounded = [i for i, part in enumerate(best.hypothesis) if at_bound([part])]
    if bounded:
        return min(bounded, key=lows.__getitem__), AT_BOUND
    if tested.pays and all(gains.pays for gains in tested.each):
        return None
    return int(np.argmin(lows)), NO_GAIN


def _without(result: Search, i: int) -> Fit:
    """Return the best causes without one of them, fitted again."""
    rest = [part for j, part in enumerate(result.best.hypothesis) if j != i]
    if not rest:
        return null_fit(result.problem)
    step = result.step_beside(rest)
    return rescore(result.problem, step.base) if step else fit(result.problem, rest)


def _reduced(result: Search, best: Fit, dropped: Sequence[Candidate]) -> Search:
    """Return the search with fewer causes, and the noise model that these leave.

    Where the search tried as many causes that are likelier, these take their place, unless they
    are dropped ones or have a parameter at its bound. If no cause is left, the likeliest single one
    of the others does that has enough evidence. None takes the place of a stop.
    """
    if result.stop is not None:
        problem = result.problem.reinflated(best.residual)
        return replace(result, problem=problem, best=rescore(problem, best))
    if best.is_null:
        return _next_single(replace(result, best=best), dropped)
    problem = result.problem.reinflated(best.residual)
    best = rescore(problem, best)
    for step in (*result.steps, *result.revised):
        for other in step.tried:
            alike = len(other.hypothesis) == len(best.hypothesis)
            if not alike or at_bound(other.hypothesis) or _has_any(other, dropped):
                continue
            other = rescore(problem, other)
            if other.evidence > best.evidence + SWAP:
                best = other
    return replace(result, problem=problem, best=best)


def _next_single(result: Search, dropped: Sequence[Candidate]) -> Search:
    """Return a search without causes, or with the likeliest single one that was not dropped."""
    for step in result.steps[:1]:
        for single in step.tried:
            if at_bound(single.hypothesis) or _has_any(single, dropped):
                continue
            problem = result.problem.reinflated(single.residual)
            single = rescore(problem, single)
            if single.evidence > step.needed:
                return replace(result, problem=problem, best=single)
    return result


def _has_any(fitted: Fit, candidates: Sequence[Candidate]) -> bool:
    return any(one.matches(other) for one in fitted.candidates for other in candidates)
