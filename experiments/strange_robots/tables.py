"""Tables and metrics of strange robots."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.harness.experiment import Results
from experiments.harness.report import Table
from experiments.harness.statistics import median_cell, metric
from experiments.stiffness_and_load.tables import load_ratios, load_table
from experiments.strange_robots.families import (
    ABSENT,
    BONES,
    DRIFT,
    FAMILIES,
    LENS,
    NOISE,
    POINTS,
    PRESET,
    SOFT,
    SWAPPED,
)
from experiments.strange_robots.trial import Sizes
from jmm_agent.types import Floats

COMMISSIONED = {f"{SWAPPED}-commissioned": SWAPPED, f"{ABSENT}-commissioned": ABSENT}
"""Conditions with a commissioning run first, and their families."""
CONDITIONS = (*FAMILIES, *COMMISSIONED)
TITLES = {name: family.title for name, family in FAMILIES.items()} | {
    name: f"{FAMILIES[family].title}, after a commissioning run"
    for name, family in COMMISSIONED.items()
}

UNITS = {"deg": "target_true_deg", "mm": "target_true_mm"}
MUST: Mapping[str, tuple[float, float | None]] = {
    POINTS: (1.2, 14.0),
    BONES: (1.2, None),
    SOFT: (1.4, None),
}
"""Largest errors of joints [deg] and hand [mm] after the last look; None: no limit."""
MUST_RATIO = {
    LENS: 1.5,
    SWAPPED: 1.5,
    ABSENT: 1.5,
    f"{SWAPPED}-commissioned": 1.5,
    f"{ABSENT}-commissioned": 1.5,
    DRIFT: 1.2,
    NOISE: 1.2,
}
"""Largest error over that of the preset's robot after as many looks [1]."""
MUST_NAMED = {SWAPPED: 5.0, ABSENT: 5.0}
"""Number of looks within which the muscles must be named."""
NEVER = 1e3
"""Number of looks that stands for "never named" in a metric."""


def last(condition: str, sizes: Sizes) -> int:
    """Number of looks after which a condition is judged."""
    return sizes.long if condition == DRIFT else max(sizes.counts)


def conditions(results: Results) -> list[str]:
    """Conditions that were run, in the order of `CONDITIONS`."""
    return [one for one in CONDITIONS if all(one in result for result in results.values())]


def numbers(results: Results, condition: str, count: int, key: str) -> Floats:
    """An error of a condition after some looks, of each robot."""
    found = [result[condition]["errors"][str(count)][key] for result in results.values()]
    return np.array(found, dtype=float)


def metrics(results: Results, sizes: Sizes) -> dict[str, Mapping[str, Any]]:
    """Errors and ratios beside what they must be."""
    found: dict[str, Mapping[str, Any]] = {}
    known = conditions(results)
    for condition, musts in MUST.items():
        if condition not in known:
            continue
        for (unit, key), must in zip(UNITS.items(), musts, strict=True):
            after = numbers(results, condition, last(condition, sizes), key)
            found[f"{condition}_error_{unit}"] = metric(after, unit, must=must)
    if POINTS in known:
        found[f"{POINTS}_largest_share_of_error_before_mm"] = _never_worse(results, sizes)
    for condition, most in MUST_RATIO.items():
        if condition not in known:
            continue
        count = last(condition, sizes)
        for unit, key in UNITS.items():
            ratio = numbers(results, condition, count, key) / numbers(results, PRESET, count, key)
            found[f"{condition}_over_preset_{unit}"] = metric(ratio, "", must=most)
    if SOFT in known:
        found |= load_ratios(results, sizes.loads, SOFT, SOFT)
    for condition, most in MUST_NAMED.items():
        if condition not in known:
            continue
        named = [result[condition]["named_after"] for result in results.values()]
        counts = [NEVER if at is None else at for at in named]
        found[f"{condition}_named_after"] = metric(counts, "observations", must=most, by="worst")
        wrong = [len(result[condition]["false_names"]) for result in results.values()]
        found[f"{condition}_false_names"] = metric(wrong, "")
    return found


def _never_worse(results: Results, sizes: Sizes) -> dict[str, Any]:
    """Largest error of the hand after any number of looks, as a share of that before."""
    before = numbers(results, POINTS, 0, UNITS["mm"])
    each = [numbers(results, POINTS, count, UNITS["mm"]) / before for count in sizes.counts]
    return metric(np.max(each, axis=0), "", must=1.0, by="worst")


def tables(results: Results, sizes: Sizes) -> list[Table]:
    """All tables of the report."""
    shown = []
    counts = (0, *sizes.counts, sizes.long)
    for unit, key in UNITS.items():
        rows = []
        for condition in conditions(results):
            known = (0, *sizes.counts_of(condition))
            cells = [
                median_cell(numbers(results, condition, count, key)) if count in known else ""
                for count in counts
            ]
            rows.append((TITLES[condition], *cells, _must(condition, unit)))
        shown.append(
            Table(
                f"target - true [{unit}] by number of looks: median over robots (worst robot)",
                ("robot", *map(str, counts), "must"),
                rows,
                "Medians over test postures. A ratio is to the preset's robot of the same seed.",
            )
        )
    if SOFT in conditions(results):
        loads = load_table(results, sizes.loads, SOFT)
        shown.append(loads._replace(title="Loads in the hand of robots with soft wires"))
    return [*shown, _named_table(results)]


def _must(condition: str, unit: str) -> str:
    """What the error after the last look must be, in words."""
    if condition in MUST:
        most = MUST[condition][unit == "mm"]
        return "" if most is None else f"{most:g} {unit}"
    return f"{MUST_RATIO[condition]:g} x" if condition in MUST_RATIO else ""


def _named_table(results: Results) -> Table:
    rows = []
    for condition in conditions(results):
        for seed, result in results.items():
            found = result[condition]
            run = found.get("commissioning", {})
            texts = [" ".join(one) for one in run.get("found", [])] or ["-"] * bool(run)
            kinds = [f"{kind} {where}" for kind, where, _, _ in found["faults"]]
            rows.append(
                (condition, seed, " ".join(found["odd"]), _named_after(found), ", ".join(texts),
                 len(found["false_names"]), found["events"], f"{found['tension_N']:.0f}",
                 ", ".join(kinds[:4]) + (" ..." if len(kinds) > 4 else ""))
            )  # fmt: skip
    head = ("robot", "seed", "odd", "named after", "commissioning found", "false names",
            "elongations", "tension [N]", "faults named")  # fmt: skip
    note = (
        "Elongations: events by which the map explains lengths. False names: faults at muscles "
        "that are as drawn. Before: the commissioning run has named them. Tension: the largest "
        f"while learning. In the metrics {NEVER:g} looks stand for never."
    )
    return Table("What the agent named while it learned", head, rows, note)


def _named_after(found: Mapping[str, Any]) -> object:
    """Number of looks after which all odd muscles were named; in words if there is none."""
    named = {name for _, *own in found.get("commissioning", {}).get("found", []) for name in own}
    if not found["odd"]:
        return ""
    if found["named_after"] is not None:
        return found["named_after"]
    return "before" if set(found["odd"]) <= named else "never"


def per_seed(results: Results) -> dict[int, Any]:
    """Errors [deg, mm] by condition and number of looks, and what was named, of each robot."""
    return {
        seed: {
            condition: {
                "errors": {
                    count: [one[key] for key in UNITS.values()]
                    for count, one in result[condition]["errors"].items()
                },
                "named_after": result[condition]["named_after"],
                "events": result[condition]["events"],
            }
            for condition in conditions(results)
        }
        for seed, result in results.items()
    }
