"""What the ablation's numbers say: verdicts on the claims, and tables."""

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
"""By variant and outcome, one number a robot."""

HEADS = {
    "target_true_deg": "target - true [deg]",
    "estimate_seen_deg": "estimate - seen [deg]",
    "target_true_mm": "hand, target - true [mm]",
    "max_tension_N": "largest tension [N]",
    "set_mm": "map, posture set [mm]",
    "box_mm": "map, whole ranges [mm]",
}

ENOUGH = 5
"""Robots below which nothing is told for sure."""

HOLDS, REVERSED, EQUAL, OPEN = (
    "holds",
    "does not hold: the other way round",
    "does not hold: no difference",
    "cannot be told",
)
WORSE = "does not hold: worse"


def difference(found: Numbers, one: str, other: str, outcome: str) -> Interval:
    """Median over robots of one variant's outcome minus that of another, with its interval."""
    return paired(found[one][outcome], found[other][outcome])


def robots(found: Numbers) -> int:
    """Number of robots."""
    return len(found[DEFAULT]["target_true_deg"])


def verdict(claim: Claim, gap: Interval, robots: int = ENOUGH) -> str:
    """What an interval of (claimed - other) says about a claim; low outcomes are good."""
    if robots < ENOUGH:
        return OPEN
    same = SAME[claim.outcome]
    if claim.kind == "not worse":
        if gap.high <= same:
            return HOLDS
        return WORSE if gap.low > 0 else OPEN
    if gap.high < 0:
        return HOLDS
    if gap.low > 0:
        return REVERSED
    return EQUAL if max(-gap.low, gap.high) <= same else OPEN


def better_than_default(found: Numbers) -> list[str]:
    """Variants whose true error is surely below the default's, and not about equal."""
    better = []
    for name in VARIANTS:
        gap = difference(found, DEFAULT, name, "target_true_deg")
        if robots(found) >= ENOUGH and gap.low > 0 and gap.median > SAME["target_true_deg"]:
            better.append(name)
    return better


def winner(found: Numbers, without: Sequence[str] = ()) -> str:
    """The variant with the lowest median of the true error."""
    names = [name for name in VARIANTS if name not in without]
    return min(names, key=lambda name: float(np.median(found[name]["target_true_deg"])))


def metrics(found: Numbers) -> dict[str, dict[str, Any]]:
    """Errors of default and paper's rule, and whether something is better than the default."""
    entries = {}
    for name in (DEFAULT, PAPER, NONE):
        entries[f"{name}_target_true"] = metric(found[name]["target_true_deg"], "deg")
        paper = 4.99 if name == PAPER else None
        seen = found[name]["estimate_seen_deg"]
        entries[f"{name}_estimate_seen"] = metric(seen, "deg", paper=paper)
    best = winner(found, without=(DEFAULT,))
    gaps = np.subtract(found[DEFAULT]["target_true_deg"], found[best]["target_true_deg"])
    entries["default_minus_best_other"] = metric(gaps.tolist(), "deg")
    count = len(better_than_default(found))
    must = 0 if robots(found) >= ENOUGH else None
    entries["variants_better_than_default"] = metric([count], "", must)
    return entries


def told_claims(found: Numbers) -> list[dict[str, Any]]:
    """Each claim with its difference and verdict, for the summary."""
    return [
        {
            "rule": rule,
            "claim": claim.told,
            "one": claim.one,
            "other": claim.other,
            "outcome": claim.outcome,
            "difference": str(gap),
            "verdict": verdict(claim, gap, robots(found)),
        }
        for rule, claim, gap in _judged(found)
    ]


def _judged(found: Numbers) -> list[tuple[str, Claim, Interval]]:
    return [
        (rule, claim, difference(found, claim.one, claim.other, claim.outcome))
        for rule, claims in CLAIMS.items()
        for claim in claims
    ]


def claims_table(found: Numbers) -> Table:
    """The claims, what they are judged by, and the verdicts."""
    rows = [
        (
            f"{claim.told} ({rule})",
            f"{claim.one} - {claim.other}",
            f"{HEADS[claim.outcome]}: {gap}",
            difference(found, claim.one, claim.other, "target_true_deg"),
            difference(found, claim.one, claim.other, "estimate_seen_deg"),
            verdict(claim, gap, robots(found)),
        )
        for rule, claim, gap in _judged(found)
    ]
    margins = "; ".join(f"{HEADS[outcome]} {same:g}" for outcome, same in SAME.items())
    note = (
        "Differences on the same robot: median over robots and 95 % interval. That something is "
        "better holds if the whole interval is below 0. It makes no difference if the whole "
        "interval is within what counts as equal, and nothing can be told if neither is so. That "
        "something is not worse holds if the interval ends below that. As equal count "
        f"{margins}. With fewer than {ENOUGH} robots nothing is told. In brackets: by the paper's "
        "plain rule or by the default."
    )
    head = ("claim", "compared", "judged by", "target - true [deg]", "estimate - seen [deg]",
            "verdict")  # fmt: skip
    return Table("Claims", head, rows, note)


def variant_tables(found: Numbers) -> list[Table]:
    """Outcomes of all variants, and their differences from the references."""
    best = winner(found)
    rows, effects = [], []
    for name in (NONE, *VARIANTS):
        variant = VARIANTS.get(name)
        told = variant.told if variant else "no learning"
        marks = (", the winner" * (name == best), ", the paper's plain rule" * (name == PAPER))
        values = [_cell(found[name][key]) for key in HEADS]
        rows.append(("".join((name, *marks)), told, *values))
        if variant and name != variant.reference:
            gaps = [difference(found, name, variant.reference, key) for key in HEADS]
            effects.append((f"{name} - {variant.reference}", told, *gaps))
    return [
        Table(
            "All variants: median over robots (worst robot)",
            ("variant", "what", *HEADS.values()),
            rows,
            f"{_default_told(found)} {_disagreement(found)} Map: median over postures of the RMS "
            "over wires of the map's error, against what the robot's own encoders would read there "
            "with all wires at T_bias. The whole ranges reach far beyond what was learned.",
        ),
        Table(
            "What each change does: variant - reference on the same robot, median [95 % interval]",
            ("variant - reference", "what", *HEADS.values()),
            effects,
            "Below 0: the change is good.",
        ),
    ]


def _cell(values: Sequence[float]) -> str:
    return f"{interval(values).median:.1f} ({max(values):.1f})"


def _default_told(found: Numbers) -> str:
    """Whether something is better than the default."""
    if robots(found) < ENOUGH:
        return "There are too few robots to tell what is surely better."
    better = better_than_default(found)
    if better:
        return f"Surely better than the default: {', '.join(better)}."
    return "No variant is surely better than the default."


def _disagreement(found: Numbers) -> str:
    """Which variants are better by one definition of error and worse by the other."""
    if robots(found) < ENOUGH:
        return ""
    from_reference = [n for n, v in VARIANTS.items() if _torn(found, n, v.reference)]
    from_none = [name for name in VARIANTS if _torn(found, name, NONE)]
    if not from_reference and not from_none:
        return "Nowhere do estimate - seen and target - true surely disagree on what is better."
    return (
        "Estimate - seen and target - true surely disagree, one lower and the other higher, "
        f"beside the reference for: {', '.join(from_reference) or 'none'}; beside no learning "
        f"for: {', '.join(from_none) or 'none'}."
    )


def _torn(found: Numbers, name: str, beside: str) -> bool:
    """Whether the two errors surely differ in opposite ways, by more than counts as equal."""
    signs = []
    outcomes: tuple[Outcome, Outcome] = ("estimate_seen_deg", "target_true_deg")
    for outcome in outcomes:
        gap = difference(found, name, beside, outcome)
        sure = (gap.low > 0 or gap.high < 0) and abs(gap.median) > SAME[outcome]
        signs.append(np.sign(gap.median) if sure else 0.0)
    return bool(signs[0] * signs[1] < 0)
