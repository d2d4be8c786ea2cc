"""The verdict: what a search found, what it leaves, and whether that makes a name."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from reality_gap.diagnosis import Verdict
from reality_gap.inference.forward_selection import Search, Settings, revise
from reality_gap.inference.remainder import Remainder, examine
from reality_gap.simulation.replayer import Hypothesis, Replayer
from reality_gap.types import Floats

BEATEN = 1.1
"""Evidence of a learner in place of the causes, over theirs, that makes them no names."""
LEFT = 5.0
"""What a learner finds in what causes leave, over what it may, that makes them no names."""

NEAR = 0.01
"""Distance of a parameter from its bound, over the bound's from the null, that counts as none."""


@dataclass(frozen=True)
class Options:
    """How to diagnose.

    Attributes:
        search: thresholds for causes.
        unexplained: share of what could be learned of the gap that may remain, at most.
        certain: what a learner must find in the remainder to call it unexplained [nats].
        root: of the evidence for the causes; so many of it a learner may find in what they leave.
        better: by how much a learner must beat the causes without them [nats].
        by_chance: share of an event's evidence that a learner who knows no time may have, at most.
        worse: RMS on the report split that named causes may leave beside tolerances, though it was
            less without them [noise].
        tolerance: how much more than usual an honest drawing of this machine may be off.
        visible: change of the readings by three typical faults, in noise, that can be judged.
        suggest: whether to look for the next experiment.
        many: residual, in noise, from which on groups are fitted before anything else is tried.
        large: the same where the best of all other causes leaves it.
        search_after_groups: whether to search for single causes, too, where groups explain the
            log; None: where the machine has no more than 20 wires.
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


def weighed(
    replayer: Replayer, result: Search, null: Floats, settings: Settings, options: Options
) -> tuple[Search, Remainder]:
    """The causes, looked at anew beside each other, and what they leave.

    Causes that a learner beats by far, in their place or beside them, are no names, and are left as
    they are.
    """

    def leaves(found: Search) -> Remainder:
        best = found.best
        if best is None:
            return examine(replayer, found.noise_model, [], null, null)
        return examine(replayer, found.noise_model, best.hypothesis, best.residual, null)

    left = leaves(result)
    if result.best is None:
        return result, left
    named = result.best.evidence
    beaten = left.instead.evidence > max(BEATEN * named, named + options.better)
    if beaten or left.learned.evidence > LEFT * _may_leave(named, options):
        return result, left
    revised = revise(replayer, result, settings)
    return revised, left if revised.best is result.best else leaves(revised)


def decide(result: Search, left: Remainder, pays: bool, options: Options) -> Verdict:
    """Named if the causes leave little that could still be learned, and hold where not fitted.

    Args:
        result: the causes.
        left: what they leave.
        pays: whether the causes surely predict the report split better than the study's model.
        options: thresholds.
    """
    if result.best is None or not pays:
        # Without causes both are of the whole gap.
        found = left.instead.evidence > options.certain
        return Verdict.UNEXPLAINED if found else Verdict.NOTHING_WRONG
    if at_bound(result.best.hypothesis):
        return Verdict.UNEXPLAINED
    named = result.best.evidence
    much = left.learned.evidence > _may_leave(named, options)
    better = left.instead.evidence > named + options.better
    worse = left.after > max(left.before, options.worse)
    # A stop that the machine runs into in each episode looks like a push.
    events = all(candidate.cause.event for candidate in result.best.candidates)
    no_event = events and left.instead.evidence > options.by_chance * named
    return Verdict.UNEXPLAINED if much or better or worse or no_event else Verdict.NAMED


def at_bound(hypothesis: Hypothesis) -> bool:
    """Whether a parameter went as far as it may: what it stands for is something else."""
    return any(
        abs(values[p.name] - bound) <= NEAR * abs(bound - p.null)
        for candidate, values in hypothesis
        for p in candidate.parameters
        for bound in (p.low, p.high)
        if bound != p.null and np.isfinite(bound)
    )


def _may_leave(named: float, options: Options) -> float:
    """What a learner may find in what causes of such evidence leave [nats]."""
    return max(options.certain, min(options.unexplained * named, options.root * named**0.5))
