"""Support: causes of little evidence are named only if they are likelier than not.

A cause may pay on held-out data although several others, or errors that are learned from the
motion, do so nearly as well. Causes that the data cannot tell from it are declared equivalent, and
count with it. Where others predict something else, the likeliest one may still be wrong most of
the time. One with much evidence is named with its low confidence nevertheless: a model with it
predicts better than without. But none is named that is hardly possible.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from reality_gap.diagnosis import Criterion, Verdict
from reality_gap.inference.confidence import unmodelled
from reality_gap.inference.equivalence import Alternatives, alternatives, first_attempt
from reality_gap.inference.paying import UNLIKELY, Paying, without_cause
from reality_gap.inference.remainder import Remainder
from reality_gap.inference.verdict import Options, decide, judge, remainder_of


class Supported(NamedTuple):
    """Causes that pay and are no guesses.

    Attributes:
        paying: the causes.
        remainder: what they leave, or what the best attempt leaves if none is left.
        alternatives: what was tried in the place of each, or first if there is none.
        criteria: the probabilities and evidence that were compared.
    """

    paying: Paying
    remainder: Remainder
    alternatives: tuple[Alternatives, ...]
    criteria: tuple[Criterion, ...]


def keep_supported(paying: Paying, remainder: Remainder, options: Options) -> Supported:
    """Drop guesses: causes of little evidence that are less likely than not, the worst one first.

    Args:
        paying: the causes that pay.
        remainder: what they leave.
        options: thresholds.
    """
    criteria = list[Criterion]()
    while (verdict := decide(paying, judge(paying, remainder, options))).has_names:
        refused = [one.candidate for one in paying.dropped if one.reason != UNLIKELY]
        found = alternatives(paying.result, options.search, refused=refused)
        modelled = _modelled(paying, remainder)
        tested = [_criterion(one, modelled * one.support, options) for one in found]
        missed = [i for i, one in enumerate(tested) if not one.met]
        if not missed:
            return Supported(paying, remainder, found, (*tested, *criteria))
        worst = min(missed, key=lambda i: tested[i].value)
        criteria.append(tested[worst])
        paying = without_cause(paying, worst, UNLIKELY)
        remainder = remainder_of(paying)
    tried = _of_the_attempt(paying, verdict, options)
    return Supported(paying, remainder, tried, tuple(criteria))


def _modelled(paying: Paying, remainder: Remainder) -> float:
    """Return the probability that no unknown cause has the whole effect of the causes."""
    named = paying.result.best.evidence + remainder.learned.evidence
    return 1.0 - unmodelled(named, remainder.instead.evidence)


def _of_the_attempt(paying: Paying, verdict: Verdict, options: Options) -> tuple[Alternatives, ...]:
    """Return what was tried in the place of each cause of an attempt, or first if it has none."""
    result = replace(paying.result, best=paying.attempt)
    if result.best.is_null and verdict is Verdict.UNEXPLAINED:
        return first_attempt(result)
    return alternatives(result, options.search, retry=False)


def _criterion(one: Alternatives, support: float, options: Options) -> Criterion:
    """Return the criterion of a cause: its probability, or its evidence where that is enough."""
    enough = options.possible if one.own >= options.guess else options.likely
    if enough <= support < options.likely:
        return Criterion(f"guess: {one.candidate}", one.own, options.guess, True, UNLIKELY)
    met = support >= enough
    return Criterion(f"support: {one.candidate}", support, enough, met, UNLIKELY)
