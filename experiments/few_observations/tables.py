"""Tables and metrics of few observations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.few_observations.methods import (
    BLIND,
    BY_SOURCE,
    GIVEN,
    METHODS,
    NOT_OURS,
    OURS,
    Sizes,
    best_other,
    numbers,
)
from experiments.few_observations.sources import SOURCES
from experiments.harness.experiment import Results
from experiments.harness.report import Table
from experiments.harness.statistics import interval, median_cell, metric, paired

MUST = {"share_deg": {1: 0.55, 3: 0.25}, "share_mm": {1: 0.35, 3: 0.20}}
"""Largest shares of the errors before, after some looks."""
MUST_AFTER = {5: (2.0, 25.0), 27: (1.2, 12.0)}
"""Largest errors of joints [deg] and hand [mm] after some looks."""
HALF = 0.5


def metrics(results: Results, sizes: Sizes) -> dict[str, Mapping[str, Any]]:
    """Errors of ours, and their differences from the best other method on the same robots.

    The best other method is the one with the lowest median after that number of looks.
    """
    found: dict[str, Mapping[str, Any]] = {}
    for unit in ("deg", "mm"):
        key = f"target_true_{unit}"
        before = np.array(numbers(results, OURS, 0, key))
        for count in sizes.counts:
            after = numbers(results, OURS, count, key)
            share, limit = after / before, MUST[f"share_{unit}"].get(count)
            found[f"share_of_error_after_{count}_{unit}"] = metric(share, "", must=limit)
            limits = MUST_AFTER.get(count)
            most = None if limits is None else limits[unit == "mm"]
            found[f"error_after_{count}_{unit}"] = metric(after, unit, must=most)
            other = numbers(results, best_other(results, count, key), count, key)
            gap = np.subtract(after, other).tolist()
            found[f"above_best_other_after_{count}_{unit}"] = metric(gap, unit, must=0.0)
        blind = [
            result[BLIND][str(sizes.blind)][key] / result[BLIND]["0"][key]
            for result in results.values()
        ]
        limit = HALF if unit == "deg" else None
        found[f"share_of_error_blind_{unit}"] = metric(blind, "", must=limit)
    return found


def _error_table(results: Results, sizes: Sizes, key: str, unit: str) -> Table:
    counts = (0, *sizes.counts)
    rows = []
    for name, title in METHODS.items():
        cells = [median_cell(numbers(results, name, count, key)) for count in counts]
        rows.append((title, *cells))
    first, last = (
        median_cell([result[BLIND][count][key] for result in results.values()])
        for count in ("0", str(sizes.blind))
    )
    rows.append(
        (f"ours, {sizes.blind} postures that are not seen", first, last) + ("",) * (len(counts) - 2)
    )
    return Table(
        f"target - true [{unit}] by number of looks: median over robots (worst robot)",
        ("method", *map(str, counts)),
        rows,
        "Medians over the test postures. Of the blind postures, the second column is after all.",
    )


def _source_table(results: Results) -> Table:
    rows = []
    for name, title in SOURCES.items():
        parts = [result[BY_SOURCE][name] for result in results.values()]
        error = interval([part["error_deg"] for part in parts])
        predicted = interval([part["predicted_deg"] for part in parts])
        covered = np.mean([part["covered"] for part in parts])
        rows.append((title, f"{error.median:.1f}", f"{predicted.median:.1f}", f"{covered:.2f}"))
    return Table(
        "What each source tells of the joint angles of ten rests",
        ("source", "error [deg]", "predicted [deg]", "inside of 95 %"),
        rows,
        "RMS over rests and joints, median over robots: true errors, and standard deviations that "
        "the fit predicts. Last: share of joint angles within 1.96 of these.",
    )


def tables(results: Results, sizes: Sizes) -> list[Table]:
    """All tables of the report."""
    keys = {"target_true_deg": "deg", "target_true_mm": "mm", "max_tension_N": "N"}
    shown = [_error_table(results, sizes, key, unit) for key, unit in keys.items()]
    differences = [
        (
            METHODS[name],
            *(
                f"{found.median:.2f} ({found.low:.2f} to {found.high:.2f})"
                for found in (
                    paired(
                        numbers(results, OURS, count, "target_true_deg"),
                        numbers(results, name, count, "target_true_deg"),
                    )
                    for count in sizes.counts
                )
            ),
        )
        for name in NOT_OURS
    ]
    best = (
        f"{METHODS[best_other(results, count, 'target_true_deg')]} ({count})"
        for count in sizes.counts
    )
    shown += [
        Table(
            "Ours minus each method [deg], paired by robot: median (95 % interval)",
            ("method", *map(str, sizes.counts)),
            differences,
            f"Below 0: ours is nearer to its targets. Best of the others: {'; '.join(best)}.",
        ),
        _source_table(results),
    ]
    return shown


def per_seed(results: Results) -> dict[int, Any]:
    """Errors of the joints by method and number of looks, of each robot [deg]."""
    return {
        seed: {
            name: {
                count: found["target_true_deg"]
                for count, found in result[OURS if name in GIVEN else name][name].items()
            }
            for name in METHODS
        }
        for seed, result in results.items()
    }
