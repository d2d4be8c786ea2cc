"""Looks at postures that the agent chooses, beside random ones, and what it expected of each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.few_observations.methods import CHOSEN, OURS, Sizes, numbers
from experiments.harness.experiment import Results
from experiments.harness.report import Table
from experiments.harness.statistics import interval, median_cell, metric, paired
from jmm_agent.prediction_record import PredictionRecord

UNITS = {"target_true_deg": "deg", "target_true_mm": "mm"}
"""Errors that are compared, and their units."""
TITLES = {OURS: "random postures", CHOSEN: "chosen postures"}
COVERED = 0.90, 0.98
"""Share of looks that regions of 95 % must cover [1]."""


def predicted_observations(record: PredictionRecord) -> list[dict[str, Any]]:
    """What was expected of each look before it was learned, and how far it was from that."""
    found = []
    for predicted, seen in record.newest:
        expected = seen.hand_error
        found.append(
            {
                "inside": predicted.inside,
                "distance": round(predicted.distance, 4),
                "error_mm": round(1e3 * predicted.position_error, 3),
                "expected_mm": round(1e3 * predicted.position_std, 3),
                "error_deg": round(float(np.degrees(predicted.rotation_error)), 3),
                "expected_deg": round(float(np.degrees(predicted.rotation_std)), 3),
                "hand_before_mm": None if expected is None else round(1e3 * expected.before, 3),
                "hand_after_mm": None if expected is None else round(1e3 * expected.after, 3),
                "reason": seen.reason,
            }
        )
    return found


def _kinds(results: Results) -> list[str]:
    """Kinds of looks that were run on all robots."""
    return [kind for kind in TITLES if all(_has(result, kind) for result in results.values())]


def _has(result: Mapping[str, Any], kind: str) -> bool:
    return "predictions" in result.get(kind, {})


def posture_metrics(results: Results, sizes: Sizes) -> dict[str, Mapping[str, Any]]:
    """Coverage of the predictions, and errors with chosen postures minus those with random ones."""
    found: dict[str, Mapping[str, Any]] = {}
    kinds = _kinds(results)
    for kind in kinds:
        observations = [one for result in results.values() for one in result[kind]["predictions"]]
        if not observations:
            continue
        covered = float(np.mean([one["inside"] for one in observations]))
        low, high = COVERED
        name = f"inside_of_95_percent_{kind}"
        found[name] = metric([covered], "", must=low, good="high")
        found[f"{name}_at_most"] = metric([covered], "", must=high)
    if kinds != list(TITLES):
        return found
    for key, unit in UNITS.items():
        for count in sizes.counts:
            chosen, random = (numbers(results, kind, count, key) for kind in (CHOSEN, OURS))
            gap = np.subtract(chosen, random)
            found[f"chosen_minus_random_after_{count}_{unit}"] = metric(gap, unit, must=0.0)
    return found


def posture_tables(results: Results, sizes: Sizes) -> list[Table]:
    """Errors with chosen and with random postures, and what was expected of looks."""
    kinds = _kinds(results)
    tables = [_expectations(results, kinds)] if kinds else []
    if kinds == list(TITLES):
        tables = [_compared(results, sizes, key, unit) for key, unit in UNITS.items()] + tables
    return tables


def _compared(results: Results, sizes: Sizes, key: str, unit: str) -> Table:
    counts, rows = (0, *sizes.counts), []
    for kind, title in TITLES.items():
        cells = [median_cell(numbers(results, kind, count, key), 2) for count in counts]
        rows.append((title, *cells))
    gaps = [
        paired(numbers(results, CHOSEN, count, key), numbers(results, OURS, count, key))
        for count in counts
    ]
    cells = [f"{gap.median:.2f} ({gap.low:.2f} to {gap.high:.2f})" for gap in gaps]
    rows.append(("chosen minus random, paired", *cells))
    return Table(
        f"Chosen and random postures: target - true [{unit}] by number of looks",
        ("postures", *map(str, counts)),
        rows,
        "Median over robots (worst robot); differences: median (95 % interval). Below 0: chosen "
        "postures tell more.",
    )


def _expectations(results: Results, kinds: list[str]) -> Table:
    """Errors of predicted looks beside those that were expected, early and late ones."""
    rows = []
    for kind in kinds:
        robots = [result[kind]["predictions"] for result in results.values()]
        parts = {"first": slice(0, 1), "2 to 5": slice(1, 5), "later": slice(5, None)}
        for name, part in {**parts, "all": slice(None)}.items():
            observations = [one for robot in robots for one in robot[part]]
            if not observations:
                continue
            inside = np.mean([one["inside"] for one in observations])
            cells = [
                f"{interval([one[key] for one in observations]).median:.1f}"
                for key in ("error_mm", "expected_mm", "error_deg", "expected_deg")
            ]
            rows.append((TITLES[kind], name, len(observations), *cells, f"{inside:.3f}"))
    head = ("postures", "predictions", "number", "error [mm]", "expected [mm]")
    return Table(
        "Looks, as expected before they were learned and as seen",
        (*head, "error [deg]", "expected [deg]", "inside of 95 %"),
        rows,
        "Medians over looks of all robots: distance and angle of the hand's marker from where it "
        "was expected, and what was expected of both. Last: share within the region of 95 %.",
    )


def posture_errors(results: Results) -> dict[int, Any]:
    """Errors of the joints [deg] with random and chosen postures, of each robot."""
    return {
        seed: {
            kind: {n: found["target_true_deg"] for n, found in result[kind][kind].items()}
            for kind in TITLES
            if kind in result
        }
        for seed, result in results.items()
    }
