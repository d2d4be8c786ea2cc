"""Metrics and tables of the baselines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.harness.report import Table
from experiments.harness.statistics import interval, metric, paired

NO_LEARNING, TABLE, GAUSSIAN, OURS = "no learning", "table", "Gaussian process", "ours"
POLYNOMIALS = {degree: f"polynomial, degree {degree}" for degree in (2, 3, 4)}

ENOUGH = 5
"""Least number of robots for a verdict."""

OUTCOMES = {
    "target_true_deg": "target - true [deg]",
    "estimate_seen_deg": "estimate - seen [deg]",
    "target_true_mm": "hand, target - true [mm]",
    "estimate_seen_mm": "hand, estimate - seen [mm]",
    "max_tension_N": "largest tension [N]",
    "update_ms": "one update [ms of one core]",
}

Numbers = dict[str, dict[str, list[float]]]
"""By method and outcome: one number a robot."""


def middle(found: Numbers, name: str, outcome: str) -> float:
    """Median over robots."""
    return float(np.median(found[name][outcome]))


def best(found: Numbers, outcome: str, without: Sequence[str] = ()) -> str:
    """The method with the lowest median of an outcome."""
    return min(
        (name for name in found if name not in without),
        key=lambda name: middle(found, name, outcome),
    )


def metrics(by_count: Mapping[int, Numbers]) -> dict[str, dict[str, Any]]:
    """Metrics of ours by number of postures, and of its difference from the best other method."""
    entries = {}
    for count, found in by_count.items():
        true = found[OURS]["target_true_deg"]
        entries[f"ours_target_true_{count}"] = metric(true, "deg")
        entries[f"ours_estimate_seen_{count}"] = metric(found[OURS]["estimate_seen_deg"], "deg")
        entries[f"ours_hand_true_{count}"] = metric(found[OURS]["target_true_mm"], "mm")
        other = found[best(found, "target_true_deg", without=(OURS,))]["target_true_deg"]
        gaps = np.subtract(true, other).tolist()
        entries[f"ours_minus_best_other_{count}"] = metric(gaps, "deg")
    return entries


def counted_tables(
    by_count: Mapping[int, Numbers], pairs: Mapping[int, Sequence[int]]
) -> list[Table]:
    """Tables of the outcomes of all methods, one for each number of postures."""
    return [
        Table(
            f"After {count} postures: median over robots (worst robot)",
            ("method", *OUTCOMES.values(), "target - true, minus ours [deg]"),
            _rows(found),
            f"{np.median(pairs[count]):g} pairs ({min(pairs[count])} to {max(pairs[count])}). "
            f"{_best_note(found)} An update makes the map from all pairs; its time does not "
            "include the fit of observations. Last column: median and 95 % "
            "interval of the difference on the same robot.",
        )
        for count, found in by_count.items()
    ]


def _rows(found: Numbers) -> list[tuple[object, ...]]:
    return [
        (
            name,
            *(_cell(outcomes.get(key, ())) for key in OUTCOMES),
            "" if name == OURS else _gap(found, name, found, OURS),
        )
        for name, outcomes in found.items()
    ]


def _cell(values: Sequence[float]) -> str:
    return f"{interval(values).median:.1f} ({max(values):.1f})" if values else "-"


def _gap(
    one: Numbers, name: str, other: Numbers, reference: str, outcome: str = "target_true_deg"
) -> str:
    return str(paired(one[name][outcome], other[reference][outcome]))


def _best_note(found: Numbers) -> str:
    """Sentences on the best method by each definition of error, and on significant differences."""
    true, seen = best(found, "target_true_deg"), best(found, "estimate_seen_deg")
    if true == seen:
        text = f"Best by target - true and by estimate - seen: {true}."
    else:
        text = f"Best by target - true: {true}; by estimate - seen: {seen}."
    if len(found[OURS]["target_true_deg"]) < ENOUGH:
        return f"{text} There are too few robots to decide which methods are better."
    gaps = {
        name: paired(outcomes["target_true_deg"], found[OURS]["target_true_deg"])
        for name, outcomes in found.items()
        if name != OURS
    }
    better = [name for name, gap in gaps.items() if gap.high < 0]
    worse = [name for name, gap in gaps.items() if gap.low > 0]
    return (
        f"{text} By target - true, significantly better than ours: {_listed(better)}; "
        f"significantly worse: {_listed(worse)}."
    )


def _listed(names: Sequence[str]) -> str:
    return "; ".join(names) if names else "none"


def one_observation_table(together: Numbers, alone: Numbers, count: int) -> Table:
    """Table of the effect of the joint fit of observations on each method."""
    rows = [
        (
            name,
            *(
                _cell(found[name][key])
                for key in ("target_true_deg", "estimate_seen_deg", "target_true_mm")
                for found in (together, alone)
            ),
            _gap(alone, name, together, name),
            _gap(alone, name, together, name, "estimate_seen_deg"),
        )
        for name in alone
    ]
    head = [f"{OUTCOMES[key]}, {how}"
            for key in ("target_true_deg", "estimate_seen_deg", "target_true_mm")
            for how in ("together", "alone")]  # fmt: skip
    return Table(
        f"After {count} postures, with pairs from each observation alone",
        (
            "method",
            *head,
            "target - true, alone minus together [deg]",
            "estimate - seen, alone minus together [deg]",
        ),
        rows,
        "Alone: the joint angles of each pair are from the paper's inverse kinematics of one "
        "observation, nearest to the estimate at that time. That estimate is from the agent that "
        "fits observations together, which favours this variant. Ours alone is one update of the "
        "nominal map.",
    )


def nominal_table(found: Numbers, count: int) -> Table:
    """Table of the robots without departures, where the nominal map has no error."""
    return Table(
        f"Robots without departures, after {count} postures: median over robots (worst robot)",
        ("method", *OUTCOMES.values(), "target - true, minus ours [deg]"),
        _rows(found),
        "The error without learning is sag, not an error of the nominal model. "
        + _best_note(found),
    )
