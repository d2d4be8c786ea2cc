"""Tables of the diagnosis trials: criteria, confusion, each cause, and the baselines."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from experiments.gap_bench.criteria import ERRORS
from experiments.gap_bench.scores import (
    NOTHING,
    UNEXPLAINED,
    Trial,
    first_name,
    parameter_error,
    right_first,
    right_location,
    right_or_equivalent,
    same_location,
    truth,
)
from experiments.harness.report import Table

NO_FAULT = "(no fault)"
PASSES = 0.05
"""Share of fault-free logs on which a baseline names a cause."""


def confusion(trials: Sequence[Trial]) -> dict[str, dict[str, int]]:
    """Counts of the first name (column) by single effect (row), with a row of fault-free logs."""
    found: dict[str, Counter[str]] = {}
    for t in trials:
        if t["case"]["kind"] != "pair":
            row = truth(t) if t["truth"] else NO_FAULT
            found.setdefault(row, Counter())[first_name(t)] += 1
    outside = {truth(t) for t in trials if t["case"]["kind"] == "outside"}
    order = sorted(found, key=lambda row: (row in outside, row == NO_FAULT, row))
    return {row: dict(sorted(found[row].items())) for row in order}


def confusion_table(matrix: Mapping[str, Mapping[str, int]]) -> Table:
    """Table of the first names by hidden effect."""
    rows = []
    for row, counts in matrix.items():
        named = ", ".join(f"{n} {k}" for k, n in sorted(counts.items(), key=lambda x: -x[1]))
        rows.append((row, sum(counts.values()), named))
    return Table("First name by hidden effect", ("hidden", "n", "named first"), rows)


def causes_table(trials: Sequence[Trial]) -> Table:
    """Table of the scores of each cause."""
    single = [t for t in trials if t["case"]["kind"] == "single"]
    rows = []
    for id in sorted({truth(t) for t in single}):
        own = [t for t in single if truth(t) == id]
        errors = [e for e in map(parameter_error, own) if e is not None]
        error = ""
        if errors:
            error = f"{np.median([e for _, e in errors]):.2g} {ERRORS[errors[0][0]][1]}"
        tests: tuple[Callable[[Trial], bool | None], ...]
        tests = (right_first, right_or_equivalent, right_location)
        counts = [_of(map(test, own)) for test in tests]
        rows.append((id, len(own), *counts, error))
    head = ("cause", "n", "right first", "or equivalent", "right location", "median error")
    return Table("Single effects by cause", head, rows)


def _of(right: Iterable[bool | None]) -> str:
    known = [bool(x) for x in right if x is not None]
    return f"{sum(known)} of {len(known)}" if known else ""


BASELINES = {
    "correlation": "largest correlation",
    "free_parameters": "mujoco.sysid, all parameters free",
}


def baselines_table(trials: Sequence[Trial]) -> Table:
    """Table of diagnosis and baselines on the same logs."""
    rows: list[tuple[object, ...]] = [("diagnosis", *_ours(trials))]
    for key, title in BASELINES.items():
        own = [t for t in trials if t["baselines"][key] is not None]
        if own:
            rows.append((title, *_theirs(own, key)))
            if len(own) < len(trials):
                rows.append((f"diagnosis, on the logs of {title}", *_ours(own)))
    head = (
        "",
        "logs",
        "right first",
        "right location",
        "false alarms",
        "outside rejected",
        "threshold",
    )
    note = (
        f"A baseline names nothing below its threshold, which is set such that {PASSES:.0%} of the "
        "fault-free logs of this run exceed it; this favours the baseline. Outside effects are "
        "rejected if no cause is named for them; a baseline does so only if it misses them."
    )
    return Table("Baselines on the same logs", head, rows, note)


def _ours(trials: Sequence[Trial]) -> tuple[object, ...]:
    single, null, outside = _kinds(trials)
    return (
        len(trials),
        _of(map(right_first, single)),
        _of(map(right_location, single)),
        _of(first_name(t) != NOTHING for t in null),
        _of(first_name(t) in (UNEXPLAINED, NOTHING) for t in outside),
        "",
    )


def _theirs(trials: Sequence[Trial], key: str) -> tuple[object, ...]:
    single, null, outside = _kinds(trials)
    scores = [t["baselines"][key]["score"] for t in null]
    limit = float(np.quantile(scores, 1 - PASSES)) if scores else 0.0
    named = [t for t in single if t["baselines"][key]["score"] > limit]
    right = sum(t["baselines"][key]["cause"] == truth(t) for t in named)
    placed = [t for t in single if t["truth"][0]["elements"]]
    there = sum(
        same_location(t, truth(t), t["truth"][0]["elements"], t["baselines"][key]["elements"])
        for t in named
        if t["truth"][0]["elements"]
    )
    return (
        len(trials),
        f"{right} of {len(single)}",
        f"{there} of {len(placed)}",
        _of(score > limit for score in scores),
        _of(t["baselines"][key]["score"] <= limit for t in outside),
        f"{limit:.3g}",
    )


def _kinds(trials: Sequence[Trial]) -> tuple[list[Trial], list[Trial], list[Trial]]:
    single, null, outside = (
        [t for t in trials if t["case"]["kind"] == kind] for kind in ("single", "null", "outside")
    )
    return single, null, outside
