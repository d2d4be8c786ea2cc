"""Numbers and tables of the baselines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.harness.report import Table
from experiments.harness.statistics import interval, metric, paired

NO_LEARNING, TABLE, GAUSSIAN, OURS = "no learning", "table", "Gaussian process", "ours"
POLYNOMIALS = {degree: f"polynomial, degree {degree}" for degree in (2, 3, 4)}

ENOUGH = 5
"""Robots below which nothing is told for sure."""

OUTCOMES = {
    "target_true_deg": "target - true [deg]",
    "estimate_seen_deg": "estimate - seen [deg]",
    "target_true_mm": "hand, target - true [mm]",
    "estimate_seen_mm": "hand, estimate - seen [mm]",
    "max_tension_N": "largest tension [N]",
    "update_ms": "one update [ms of one core]",
}

Numbers = dict[str, dict[str, list[float]]]
"""By method and outcome, one number a robot."""


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
    """Ours by number of postures, and its difference from the best of the others."""
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
    """Outcomes of all methods after each number of postures."""
    return [
        Table(
            f"After {count} postures: median over robots (worst robot)",
            ("method", *OUTCOMES.values(), "target - true, less ours [deg]"),
            _rows(found),
            f"{np.median(pairs[count]):g} pairs ({min(pairs[count])} to {max(pairs[count])}). "
            f"{_told(found)} An update makes the map from all pairs; the fit of looks that brought "
            "them is not in its time. Last column: median and 95 % interval on the same robot.",
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
    one: Numbers, name: str, other: Numbers, beside: str, outcome: str = "target_true_deg"
) -> str:
    return str(paired(one[name][outcome], other[beside][outcome]))


def _told(found: Numbers) -> str:
    """Who is best by either definition of error, and whether somebody is surely better than us."""
    true, seen = best(found, "target_true_deg"), best(found, "estimate_seen_deg")
    if true == seen:
        told = f"Best by target - true and by estimate - seen: {true}."
    else:
        told = f"Best by target - true: {true}; by estimate - seen, which disagrees: {seen}."
    if len(found[OURS]["target_true_deg"]) < ENOUGH:
        return f"{told} There are too few robots to tell what is surely better."
    gaps = {
        name: paired(outcomes["target_true_deg"], found[OURS]["target_true_deg"])
        for name, outcomes in found.items()
        if name != OURS
    }
    better = [name for name, gap in gaps.items() if gap.high < 0]
    worse = [name for name, gap in gaps.items() if gap.low > 0]
    return (
        f"{told} By target - true, surely better than ours: {_listed(better)}; surely worse: "
        f"{_listed(worse)}."
    )


def _listed(names: Sequence[str]) -> str:
    return "; ".join(names) if names else "none"


def one_observation_table(together: Numbers, alone: Numbers, count: int) -> Table:
    """What the fit of looks is worth to each method."""
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
        f"The same after {count} postures with pairs of each look alone",
        (
            "method",
            *head,
            "target - true, alone less together [deg]",
            "estimate - seen, alone less together [deg]",
        ),
        rows,
        "Alone: the joint angles of each pair by the paper's inverse kinematics of one look, "
        "nearest to the estimate of the time. That estimate is of the agent that fits looks "
        "together, so this still flatters looks alone; and ours alone is one update of the "
        "drawing's map.",
    )


def drawing_table(found: Numbers, count: int) -> Table:
    """The robot without departures: what is not the map's error."""
    return Table(
        f"Robots without departures, after {count} postures: median over robots (worst robot)",
        ("method", *OUTCOMES.values(), "target - true, less ours [deg]"),
        _rows(found),
        f"What is left without learning is no error of the drawing: it is sag. {_told(found)}",
    )
