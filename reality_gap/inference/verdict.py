"""Verdict: decides whether the causes that a search found are named."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from reality_gap.diagnosis import Verdict
from reality_gap.inference.forward_selection import Search, Settings, revise
from reality_gap.inference.remainder import Remainder, evaluate_remainder
from reality_gap.simulation.hypothesis import Hypothesis

BEATEN = 1.1
"""Ratio of the evidence of a learned residual in place of the causes to theirs, above which the
causes are not named."""
LEFT = 5.0
"""Ratio of the evidence of what is learned of the remainder to what is allowed, likewise."""
NEAR = 0.01
"""Distance of a parameter from its bound, relative to that of the bound from the null value, below
which the parameter counts as at its bound."""


@dataclass(frozen=True)
class Options:
    """How to diagnose.

    Attributes:
        search: thresholds of the search for causes.
        unexplained: share of the evidence of the causes that may be learned of their remainder.
        certain: evidence of a learned residual above which a remainder is unexplained [nats].
        root: multiple of the square root of the evidence of the causes that may be learned of
            their remainder.
        better: evidence by which a learned residual must exceed that of the causes to refute
            them [nats].
        by_chance: share of an event's evidence that may be learned without its time.
        worse: RMS on the report split, without what tolerances explain, that named causes may
            leave even if it was lower without them [noise].
        tolerance: factor of all tolerances of the nominal model.
        visible: change of the readings by three typical faults from which on a cause is judged
            [noise].
        suggest: whether to look for the next experiment.
        many: RMS of the residual from which on groups are fitted before the search [noise].
        large: RMS of the residual of the best causes from which on groups are fitted after the
            search [noise].
        search_after_groups: whether to search for single causes, too, if groups explain the log;
            None: only in machines with at most 20 tendons.
    """

    search: Settings = field(default_factory=Settings)
    unexplained: float = 0.15
    certain: float = 6.0
    root: float = 3.0
    better: float = 6.0
    by_chance: float = 0.5
    worse: float = 1.2
    tolerance: float = 1.0
    visible: float = 3.0
    suggest: bool = True
    many: float = 20.0
    large: float = 5.0
    search_after_groups: bool | None = None


def revise_and_evaluate(result: Search, options: Options) -> tuple[Search, Remainder]:
    """Revise the causes, and evaluate what they leave.

    Causes that a learned residual beats by far, in their place or beside them, will not be named;
    they are not revised.

    Args:
        result: the result of the search.
        options: thresholds.

    Returns:
        The result with revised causes, and their remainder.
    """
    remainder = evaluate_remainder(result.problem, result.best)
    if result.best.is_null:
        return result, remainder
    named = result.best.evidence
    beaten = remainder.instead.evidence > max(BEATEN * named, named + options.better)
    if beaten or remainder.learned.evidence > LEFT * _allowed(named, options):
        return result, remainder
    revised = revise(result, options.search)
    if revised.best is result.best:
        return revised, remainder
    return revised, evaluate_remainder(revised.problem, revised.best)


def decide(result: Search, remainder: Remainder, pays: bool, options: Options) -> Verdict:
    """Decide on the verdict.

    Causes are named if little can be learned of what they leave and if they predict readings that
    they were not fitted to.

    Args:
        result: the causes.
        remainder: what they leave.
        pays: whether the causes surely predict the report split better than the nominal model.
        options: thresholds.
    """
    if result.best.is_null or not pays:
        # Without causes, ``learned`` and ``instead`` are both of the whole gap.
        unexplained = remainder.instead.evidence > options.certain
        return Verdict.UNEXPLAINED if unexplained else Verdict.NOTHING_WRONG
    return (
        Verdict.NAMED
        if objection(result, remainder, pays, options) is None
        else Verdict.UNEXPLAINED
    )


def objection(result: Search, remainder: Remainder, pays: bool, options: Options) -> str | None:
    """Return why the best causes are not named, as the end of a sentence; None if they are.

    The arguments are those of `decide`.
    """
    best = result.best
    if best.is_null:
        return None
    if not pays:
        return "does not surely predict better the readings that were not used to find it"
    if at_bound(best.hypothesis):
        return "has a parameter at its bound"
    if remainder.learned.evidence > _allowed(best.evidence, options):
        return "leaves errors that follow the motion"
    if remainder.instead.evidence > best.evidence + options.better:
        return "explains less than errors learned from the motion do"
    if remainder.after > max(remainder.before, options.worse):
        return "predicts the readings that were not used to find it worse than the model alone"
    # A hard stop that the machine touches in each episode looks like an event.
    events = all(candidate.cause.event for candidate in best.candidates)
    if events and remainder.instead.evidence > options.by_chance * best.evidence:
        return "is an event, although the error comes back with the motion"
    return None


def at_bound(hypothesis: Hypothesis) -> bool:
    """Return whether a parameter is at its bound, which shows that the cause is another one."""
    return any(
        abs(values[p.name] - bound) <= NEAR * abs(bound - p.null)
        for candidate, values in hypothesis
        for p in candidate.parameters
        for bound in (p.low, p.high)
        if bound != p.null and np.isfinite(bound)
    )


def _allowed(named: float, options: Options) -> float:
    """Return the evidence that may be learned of what causes of this evidence leave [nats]."""
    return max(options.certain, min(options.unexplained * named, options.root * named**0.5))
