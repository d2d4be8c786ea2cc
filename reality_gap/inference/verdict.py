"""Verdict: decides whether the causes that a search found are named, and whether that is all.

Only causes that pay on held-out readings are named (`reality_gap.inference.paying`). They are
compared with a learned residual, which stands for unknown causes. None is named if the learned
residual alone explains more than the causes together with what is learned of their remainder. What
the named causes leave decides between ``NAMED`` and ``PARTLY_NAMED``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from reality_gap.diagnosis import STOP, Criterion, Verdict
from reality_gap.inference.end_stops import MORE
from reality_gap.inference.forward_selection import Search, Settings, revise
from reality_gap.inference.paying import UNLIKELY, Paying, keep_paying
from reality_gap.inference.remainder import Remainder, evaluate_remainder

REFUTING = ("learned_instead", "report_rms", "learned_of_event")
"""Criteria without which no cause is named at all."""
ABOUT = 1.1
"""Factor within which the RMS on the report split counts as equal: large tolerances explain a part
of the error of the nominal model, too."""
WHOLE = 0.8
"""Share of an event's evidence that may be learned without its time if the event explains all. What
is learned counts as far as it predicts the report split: of few readings, motions explain much by
chance."""
NOISE = 1.25
"""RMS up to which what an event leaves is noise [noise]. Right causes left 1.0 to 1.25 in logs of
machines that were made by others, whose noise is not quite the stated one."""
LITTLE = 0.05
"""Share of the RMS of all readings that an event leaves if it explains all but the form of its
edges."""
LEARNED = "explains less than errors learned from the motion do"
WORSE = "predicts the readings that were not used to find it worse than the model alone"
EVENT = "is an event, although the error comes back with the motion"
FOLLOWS = "leaves errors that follow the motion"
ABOVE = "leaves errors above the noise"
ROUGH = "leaves errors that only deviations of many times the tolerances explain"
TOGETHER = "predicts held-out readings better, but none of its causes does by itself"
OTHERS = "is one of several that predict held-out readings better"
NO_CAUSE = "explains too little of errors that follow the motion"


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
        by_chance: share of an event's evidence that may be learned without its time; more if the
            event leaves nothing but noise.
        worse: RMS on the report split, without what tolerances explain but with what their
            deviations cost, that named causes may leave even if it was lower without them [noise].
        left: RMS on the report split, without what tolerances explain, above which the causes are
            not all that is wrong [noise].
        rough: factor of the tolerances above which they do not excuse what is left.
        form: relative error of what tolerances explain, because large deviations are not linear.
        of_step: largest error of the time step that excuses what is left [noise].
        deviation: largest deviation of a parameter that excuses what is left [tolerances].
        likely: probability that a cause needs to be named, with all that predict the same.
        guess: evidence from which on a less likely cause is named, too: some cause is there, and
            the model with this one predicts better [nats].
        possible: probability below which no cause is named, whatever its evidence.
        tolerance: factor of all tolerances of the nominal model.
        visible: change of the readings by three typical faults, or by the largest one that is
            screened, from which on a cause is judged [noise].
        suggest: whether to look for the next experiment.
        many: RMS of the residual from which on groups are fitted before the search [noise].
        large: RMS of the residual of the best causes from which on groups are fitted after the
            search [noise].
        search_after_groups: whether to search for single causes, too, if groups explain the log;
            None: only in machines with at most 20 tendons.
        time_limit: longest time of the diagnosis [s].
    """

    search: Settings = field(default_factory=Settings)
    unexplained: float = 0.15
    certain: float = 10.0
    root: float = 3.0
    better: float = 6.0
    by_chance: float = 0.5
    worse: float = 1.2
    left: float = 1.5
    rough: float = 4.0
    form: float = 0.03
    of_step: float = 3.0
    deviation: float = 20.0
    likely: float = 0.5
    guess: float = 20.0
    possible: float = 0.05
    tolerance: float = 1.0
    visible: float = 3.0
    suggest: bool = True
    many: float = 20.0
    large: float = 5.0
    search_after_groups: bool | None = None
    time_limit: float = math.inf


def revise_and_evaluate(result: Search, options: Options) -> tuple[Paying, Remainder]:
    """Revise the causes, drop those that do not pay, and evaluate what the others leave.

    Causes that a learned residual refutes will not be named; they are not revised.

    Args:
        result: the result of the search.
        options: thresholds.

    Returns:
        The causes that pay, and their remainder; that of the best attempt if none pays.
    """
    remainder = evaluate_remainder(result.problem, result.best)
    if result.best.is_null:
        return keep_paying(result), remainder
    refuted = is_refuted(result.best.evidence, remainder, options)
    paying = keep_paying(result if refuted else revise(result, options.search))
    last = paying.attempt if paying.result.best.is_null else paying.result.best
    if last.hypothesis == result.best.hypothesis:
        return paying, _or_that_of_the_model(paying, remainder)
    return paying, remainder_of(paying)


def remainder_of(paying: Paying) -> Remainder:
    """Evaluate what causes that pay leave; what the best attempt leaves if none pays."""
    last = paying.attempt if paying.result.best.is_null else paying.result.best
    return _or_that_of_the_model(paying, evaluate_remainder(paying.result.problem, last))


def _or_that_of_the_model(paying: Paying, remainder: Remainder) -> Remainder:
    """Return the remainder of the model alone if no cause pays, and it is smaller.

    An attempt that predicts worse than the model alone is no reason to doubt the model.
    """
    if not paying.result.best.is_null or paying.attempted.pays:
        return remainder
    alone = evaluate_remainder(paying.result.problem, paying.result.best)
    return alone if alone.after < remainder.after else remainder


def is_refuted(named: float, remainder: Remainder, options: Options) -> bool:
    """Return whether a learned residual in place of causes explains more than they do with theirs.

    Args:
        named: evidence of the causes [nats].
        remainder: what they leave.
        options: thresholds.
    """
    return bool(remainder.instead.evidence > _beside(named, remainder, options))


def _beside(named: float, remainder: Remainder, options: Options) -> float:
    """Return the evidence of a learned residual in place of causes that refutes them [nats].

    Where they leave little, they are preferred as long as it is not surely better. Where much can
    be learned of what they leave, they are named only if they surely add to a learned residual.
    """
    learned = remainder.learned.evidence
    if learned <= _allowed(named, options):
        return named + options.better
    return max(named + learned - options.search.threshold, 0.0)


def decide(paying: Paying, criteria: Sequence[Criterion]) -> Verdict:
    """Decide on the verdict.

    Args:
        paying: the causes that pay.
        criteria: see `judge`.
    """
    if paying.result.best.is_null:
        fine = all(one.met for one in criteria)
        return Verdict.NOTHING_WRONG if fine else Verdict.UNEXPLAINED
    missed = [one for one in criteria if not one.met]
    if any(one.name in REFUTING for one in missed):
        return Verdict.UNEXPLAINED
    return Verdict.PARTLY_NAMED if missed else Verdict.NAMED


def judge(paying: Paying, remainder: Remainder, options: Options) -> tuple[Criterion, ...]:
    """Compare the remainder of the causes that pay with the thresholds.

    Args:
        paying: the causes that pay.
        remainder: what they leave.
        options: thresholds.

    Returns:
        The criteria, those first that refute all causes.
    """
    best, instead = paying.result.best, remainder.instead.evidence
    rough = _at_most("roughness", paying.result.problem.roughness, options.rough, ROUGH)
    form = _form(remainder, options)
    if best.is_null:
        most = options.certain * form**2
        found = [
            rough,
            _at_most("deviation", remainder.deviation, options.deviation, ROUGH),
            _at_most("report_noises", remainder.after, options.left * form, ABOVE),
            _at_most("learned_evidence", instead, most, NO_CAUSE),
        ]
        if paying.attempted.pays:
            found.append(_at_most("noises_before", remainder.before, ABOUT * form, TOGETHER))
        if any(one.reason == UNLIKELY for one in paying.dropped):
            attempt = paying.attempt.evidence
            found.insert(0, _at_most("evidence_of_guesses", attempt, most, OTHERS))
        return (*_stop(paying), *found)
    named, learned = best.evidence, remainder.learned.evidence
    before, after = remainder.fits
    found = [
        _at_most("learned_instead", instead, _beside(named, remainder, options), LEARNED),
        _at_most("report_rms", after, max(ABOUT * before, options.worse), WORSE),
    ]
    # A hard stop that the machine touches in each episode looks like an event.
    if all(candidate.cause.event for candidate in best.candidates):
        noise = remainder.after <= NOISE * form and learned <= 0.0
        whole = noise or remainder.share <= LITTLE
        share = max(options.by_chance, WHOLE) if whole else options.by_chance
        predicted = max(remainder.instead.explained, 0.0) * named
        known = min(instead, predicted) if whole else instead
        found.append(_at_most("learned_of_event", known, share * named, EVENT))
    return (
        *found,
        _at_most("learned_remainder", learned, _allowed(named, options) * form**2, FOLLOWS),
        *_stop(paying),
        _at_most("report_noises", remainder.after, options.left * form, ABOVE),
        _at_most("deviation", remainder.deviation, options.deviation, ROUGH),
        rough,
    )


def _stop(paying: Paying) -> list[Criterion]:
    """Return the criterion that no stop explains more than a cause, if one does."""
    stop = paying.result.stop
    return [] if stop is None else [_at_most(STOP, stop.gain, MORE, stop.objection)]


def _at_most(name: str, value: float, threshold: float, objection: str) -> Criterion:
    """Return a criterion that is met by values up to the threshold."""
    return Criterion(name, float(value), float(threshold), bool(value <= threshold), objection)


def _form(remainder: Remainder, options: Options) -> float:
    """Return the deviation of a reading, with errors of the replay and of tolerances [noise].

    The columns of tolerances are derivatives, and large deviations are not linear. Where a time
    step is too coarse, for example because joints hit their stops, extrapolation leaves an error.
    """
    form, of_step = options.form * remainder.explained, min(remainder.of_step, options.of_step)
    return float(np.sqrt(1.0 + form**2 + of_step**2))


def _allowed(named: float, options: Options) -> float:
    """Return the evidence that may be learned of what causes of this evidence leave [nats]."""
    named = max(named, 0.0)
    return max(options.certain, min(options.unexplained * named, options.root * named**0.5))
