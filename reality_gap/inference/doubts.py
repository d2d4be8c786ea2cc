"""Doubts: what lowers the confidence of each named cause, and by how much.

The confidence of a cause and its doubts add up to 1. Unknown causes come first: the candidates that
were tried share what they leave.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from reality_gap.diagnosis import Criterion, Doubt
from reality_gap.inference.confidence import doubt_beside_unknown, doubt_of_form
from reality_gap.inference.equivalence import Alternatives
from reality_gap.inference.paying import Paying
from reality_gap.inference.remainder import channel_powers

ROUNDING = 1e-12
"""Probability up to which a doubt is an error of rounding."""
UNKNOWN = "an unknown cause that has the effect of the named causes"
BESIDE = "an unknown cause with a similar effect in what remains"
FORM = "a cause that is only nearly this one, because much remains"
OTHERS = "another known cause in its place"
NONE = "no cause in its place, but deviations within the tolerances, or chance"


def doubts_of_partial(
    paying: Paying, unknown: float, judged: Sequence[Criterion]
) -> list[tuple[Doubt, ...]]:
    """Return why each cause may be wrong because of what all of them leave.

    Args:
        paying: the causes.
        unknown: probability that unknown causes have the effect of all of them.
        judged: the criteria on what they leave.
    """
    noises = next(one for one in judged if one.name == "report_noises")
    form = doubt_of_form(noises.value, noises.threshold)
    residuals = [one.residual for one in (paying.result.best, *paying.tested.without)]
    everywhere = not all(gains.is_shown for gains in paying.tested.each)
    left, *without = channel_powers(paying.result.problem, *residuals, everywhere=everywhere)
    beside = [doubt_beside_unknown(more - left, left) for more in without]
    return [
        (
            Doubt(FORM, form),
            Doubt(UNKNOWN if unknown >= one else BESIDE, (1.0 - form) * max(unknown, one)),
        )
        for one in beside
    ]


def lowered(one: Alternatives, doubts: Sequence[Doubt]) -> Alternatives:
    """Return a cause and what was tried in its place, with confidences that doubts lower."""
    right = 1.0 - sum(doubt.probability for doubt in doubts)
    return replace(one, confidence=right * one.confidence)


def all_doubts(one: Alternatives, doubts: Sequence[Doubt]) -> tuple[Doubt, ...]:
    """Return all that lowers the confidence of a cause, the likeliest first.

    Args:
        one: the cause and what was tried in its place, as `lowered` returns it.
        doubts: why unknown causes may have its effect.
    """
    tried = float(one.confidence.sum())
    none = 1.0 - sum(doubt.probability for doubt in doubts) - tried
    found = [*doubts, Doubt(OTHERS, tried - one.right), Doubt(NONE, none)]
    listed = [doubt for doubt in found if doubt.probability > ROUNDING]
    return tuple(sorted(listed, key=lambda doubt: -doubt.probability))
