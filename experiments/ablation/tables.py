"""Tables of the ablation: outcomes of the variants and verdicts on the claims."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from experiments.harness.report import Table
from experiments.harness.statistics import Interval, interval, metric, paired
from experiments.robots.variants import (
    CLAIMS,
    DEFAULT,
    NONE,
    PAPER,
    SAME,
    VARIANTS,
    Claim,
    Outcome,
)

Numbers = dict[str, dict[str, Sequence[float]]]
"""By variant and outcome: one number a robot."""

HEADS = {
    "target_true_deg": "target - true [deg]",
    "estimate_seen_deg": "estimate - seen [deg]",
    "target_true_mm": "hand, target - true [mm]",
    "max_tension_N": "largest tension [N]",
    "set_mm": "map, posture set [mm]",
    "box_mm": "map, whole ranges [mm]",
}

ENOUGH = 5
"""Least number of robots for a verdict."""

HOLDS, REVERSED, EQUAL, UNDECIDED = (
    "holds",
    "does not hold: the opposite holds",
    "does not hold: no difference",
    "undecided",
)
WORSE = "does not hold: worse"


def difference(found: Numbers, one: str, other: str, outcome: str) -> Interval:
    """Median over robots of the difference one - other of an outcome, with its interval."""
    return paired(found[one][outcome], found[other][outcome])


def robots(found: Numbers) -> int:
    """Number of robots."""
    return len(found[DEFAULT]["target_true_deg"])


def verdict(claim: Claim, gap: Interval, robots: int = ENOUGH) -> str:
    """Verdict on a claim from the interval of the difference one - other.

    Low outcomes are good. Without `ENOUGH` robots the verdict is `UNDECIDED`.
    """
    if robots < ENOUGH:
        return UNDECIDED
    same = SAME[claim.outcome]
    if claim.kind == "not worse":
        if gap.high <= same:
            return HOLDS
        return WORSE if gap.low > 0 else UNDECIDED
    if gap.high < 0:
        return HOLDS
    if gap.low > 0:
        return REVERSED
    return EQUAL if max(-gap.low, gap.high) <= same else UNDECIDED


def better_than_default(found: Numbers) -> list[str]:
    """Variants whose true error is significantly below the default's, by more than `SAME`."""
    better = []
    for name in VARIANTS:
        gap = difference(found, DEFAULT, name, "target_true_deg")
        if robots(found) >= ENOUGH and gap.low > 0 and gap.median > SAME["target_true_deg"]:
            better.append(name)
    return better


def best_variant(found: Numbers, without: Sequence[str] = ()) -> str:
    """The variant with the lowest median of the true error."""
    names = [name for name in VARIANTS if name not in without]
    return min(names, key=lambda name: float(np.median(found[name]["target_true_deg"])))


def metrics(found: Numbers) -> dict[str, dict[str, Any]]:
    """Errors of the references, and the number of variants better than the default."""
    entries = {}
    for name in (DEFAULT, PAPER, NONE):
        entries[f"{name}_target_true"] = metric(found[name]["target_true_deg"], "deg")
        paper = 4.99 if name == PAPER else None
        seen = found[name]["estimate_seen_deg"]
        entries[f"{name}_estimate_seen"] = metric(seen, "deg", paper=paper)
    best = best_variant(found, without=(DEFAULT,))
    gaps = np.subtract(found[DEFAULT]["target_true_deg"], found[best]["target_true_deg"])
    entries["default_minus_best_other"] = metric(gaps.tolist(), "deg")
    count = len(better_than_default(found))
    must = 0 if robots(found) >= ENOUGH else None
    entries["variants_better_than_default"] = metric([count], "", must)
    return entries


def judge_claims(found: Numbers) -> list[dict[str, Any]]:
    """Claims with difference and verdict, for the summary."""
    return [
        {
            "rule": rule,
            "claim": claim.text,
            "one": claim.one,
            "other": claim.other,
            "outcome": claim.outcome,
            "difference": str(gap),
            "verdict": verdict(claim, gap, robots(found)),
        }
        for rule, claim, gap in _claims(found)
    ]


def _claims(found: Numbers) -> list[tuple[str, Claim, Interval]]:
    return [
        (rule, claim, difference(found, claim.one, claim.other, claim.outcome))
        for rule, claims in CLAIMS.items()
        for claim in claims
    ]


def claims_table(found: Numbers) -> Table:
    """Claims with the differences that they are judged by, and verdicts."""
    rows = [
        (
            f"{claim.text} ({rule})",
            f"{claim.one} - {claim.other}",
            f"{HEADS[claim.outcome]}: {gap}",
            difference(found, claim.one, claim.other, "target_true_deg"),
            difference(found, claim.one, claim.other, "estimate_seen_deg"),
            verdict(claim, gap, robots(found)),
        )
        for rule, claim, gap in _claims(found)
    ]
    margins = "; ".join(f"{HEADS[outcome]} {same:g}" for outcome, same in SAME.items())
    note = (
        "Differences on the same robot: median over robots with its 95 % interval. A claim that a "
        "variant is better holds if the whole interval is below 0, and makes no difference if the "
        "whole interval is within the margin of equality. A claim that a variant is not worse "
        "holds if the interval ends below that margin. Other claims are undecided, and all are "
        f"with fewer than {ENOUGH} robots. Margins of equality: {margins}. In brackets: tested "
        "with the paper's plain rule or with the default."
    )
    head = ("claim", "compared", "judged by", "target - true [deg]", "estimate - seen [deg]",
            "verdict")  # fmt: skip
    return Table("Claims", head, rows, note)


def variant_tables(found: Numbers) -> list[Table]:
    """Outcomes of all variants, and their differences from their references."""
    best = best_variant(found)
    rows, effects = [], []
    for name in (NONE, *VARIANTS):
        variant = VARIANTS.get(name)
        description = variant.description if variant else "no learning"
        marks = (", the best" * (name == best), ", the paper's plain rule" * (name == PAPER))
        values = [_cell(found[name][key]) for key in HEADS]
        rows.append(("".join((name, *marks)), description, *values))
        if variant and name != variant.reference:
            gaps = [difference(found, name, variant.reference, key) for key in HEADS]
            effects.append((f"{name} - {variant.reference}", description, *gaps))
    return [
        Table(
            "All variants: median over robots (worst robot)",
            ("variant", "description", *HEADS.values()),
            rows,
            f"{_better_note(found)} {_disagreement(found)} Map: median over postures of the RMS "
            "over muscles of the map's error, compared with the encoder readings of the robot with "
            "all muscles at T_bias, in the posture set and in the whole joint ranges, which reach "
            "far beyond the learned postures.",
        ),
        Table(
            "Effect of each change: variant - reference on the same robot, median [95 % interval]",
            ("variant - reference", "change", *HEADS.values()),
            effects,
            "A change with a difference below 0 is an improvement.",
        ),
    ]


def _cell(values: Sequence[float]) -> str:
    return f"{interval(values).median:.1f} ({max(values):.1f})"


def _better_note(found: Numbers) -> str:
    """Sentence on the variants that are better than the default."""
    if robots(found) < ENOUGH:
        return "There are too few robots to decide which variants are better."
    better = better_than_default(found)
    if better:
        return f"Significantly better than the default: {', '.join(better)}."
    return "No variant is significantly better than the default."


def _disagreement(found: Numbers) -> str:
    """Sentence on the variants that one definition of error improves and the other worsens."""
    if robots(found) < ENOUGH:
        return ""
    from_reference = [n for n, v in VARIANTS.items() if _disagrees(found, n, v.reference)]
    from_none = [name for name in VARIANTS if _disagrees(found, name, NONE)]
    if not from_reference and not from_none:
        return "Estimate - seen and target - true never disagree significantly."
    return (
        "Estimate - seen and target - true disagree significantly, one lower and the other higher, "
        f"compared with the reference for: {', '.join(from_reference) or 'none'}; compared with no "
        f"learning for: {', '.join(from_none) or 'none'}."
    )


def _disagrees(found: Numbers, name: str, other: str) -> bool:
    """Whether the two errors differ significantly with opposite signs, by more than `SAME`."""
    signs = []
    outcomes: tuple[Outcome, Outcome] = ("estimate_seen_deg", "target_true_deg")
    for outcome in outcomes:
        gap = difference(found, name, other, outcome)
        significant = (gap.low > 0 or gap.high < 0) and abs(gap.median) > SAME[outcome]
        signs.append(np.sign(gap.median) if significant else 0.0)
    return bool(signs[0] * signs[1] < 0)
