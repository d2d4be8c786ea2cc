"""Tables of the bench: what came out, who is taken for whom, each cause, and the baselines."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from experiments.gap_bench.criteria import ERRORS, Row
from experiments.gap_bench.scores import (
    NOTHING,
    UNEXPLAINED,
    Trial,
    parameter_error,
    right_first,
    right_location,
    right_or_equivalent,
    said,
    same_location,
    truth,
)
from experiments.harness.report import Table

NO_FAULT = "(no fault)"
PASSES = 0.05
"""Share of fault-free logs that a baseline's threshold lets through."""


def musts_table(rows: Sequence[Row]) -> Table:
    """What came out."""
    head = ("", "cases", "value", "95 % interval", "must", "reached")
    lines = []
    for r in rows:
        must = "" if r.most is None else f"at most {r.most:g}"
        must = must if r.least is None else f"at least {r.least:g}"
        value = "" if r.value is None else f"{r.value:.3g} {r.unit}"
        ends = "" if r.low is None or r.high is None else f"{r.low:.3g} to {r.high:.3g}"
        answer = {True: "yes", False: "NO", None: ""}[r.reached]
        lines.append((r.name, r.cases, value, ends, must, answer))
    note = "Shares with Wilson's interval, medians and means with a bootstrap over cases."
    return Table("What came out", head, lines, note)


def confusion(trials: Sequence[Trial]) -> dict[str, dict[str, int]]:
    """How often a lone effect (row) is called by a name (column); nulls are rows, too."""
    found: dict[str, Counter[str]] = {}
    for t in trials:
        if t["case"]["kind"] != "pair":
            row = truth(t) if t["truth"] else NO_FAULT
            found.setdefault(row, Counter())[said(t)] += 1
    outside = {truth(t) for t in trials if t["case"]["kind"] == "outside"}
    order = sorted(found, key=lambda row: (row in outside, row == NO_FAULT, row))
    return {row: dict(sorted(found[row].items())) for row in order}


def confusion_table(matrix: Mapping[str, Mapping[str, int]]) -> Table:
    """The same as a table: only what was named."""
    rows = []
    for row, said_ in matrix.items():
        told = ", ".join(f"{n} {k}" for k, n in sorted(said_.items(), key=lambda x: -x[1]))
        rows.append((row, sum(said_.values()), told))
    return Table("What lone effects are called", ("hidden", "n", "named first"), rows)


def causes_table(trials: Sequence[Trial]) -> Table:
    """How each cause fares."""
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
    head = ("cause", "n", "right first", "or equivalent", "right place", "median error")
    return Table("Each cause, alone", head, rows)


def _of(right: Iterable[bool | None]) -> str:
    known = [bool(x) for x in right if x is not None]
    return f"{sum(known)} of {len(known)}" if known else ""


BASELINES = {
    "correlation": "largest correlation",
    "free_parameters": "mujoco.sysid, everything freed",
}


def baselines_table(trials: Sequence[Trial]) -> Table:
    """The diagnosis beside the baselines, each pair on the same logs."""
    rows: list[tuple[object, ...]] = [("diagnosis", *_ours(trials))]
    for key, title in BASELINES.items():
        own = [t for t in trials if t["baselines"][key] is not None]
        if own:
            rows.append((title, *_theirs(own, key)))
            if len(own) < len(trials):
                rows.append((f"diagnosis, on the logs of {title}", *_ours(own)))
    head = ("", "logs", "right first", "right place", "false alarms", "outside spared", "cut")
    note = (
        f"A baseline names nothing below its cut, which lets {PASSES:.0%} of this run's own "
        "fault-free logs through: that favours it. Outside effects are spared where no cause is "
        "named for them; a baseline can only do that by missing them."
    )
    return Table("Baselines on the same logs", head, rows, note)


def _ours(trials: Sequence[Trial]) -> tuple[object, ...]:
    single, null, outside = _kinds(trials)
    return (
        len(trials),
        _of(map(right_first, single)),
        _of(map(right_location, single)),
        _of(said(t) != NOTHING for t in null),
        _of(said(t) in (UNEXPLAINED, NOTHING) for t in outside),
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
