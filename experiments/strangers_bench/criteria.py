"""Criteria of the strangers' bench: shares of trials with their intervals and thresholds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from experiments.harness.criteria import Row, expected_error, middle, share
from experiments.harness.statistics import bootstrap_interval
from experiments.strangers_bench.scores import (
    REFUSED,
    Trial,
    covered,
    exact_set,
    false_alarm,
    false_names,
    rejected,
    right_first,
    right_location,
    sure_and_wrong,
)
from jmm_agent.types import Floats

RESAMPLES = 2000
"""Number of bootstrap samples of the calibration error."""


def of_kind(trials: Sequence[Trial], kind: str) -> list[Trial]:
    """Trials of a kind."""
    return [t for t in trials if t["case"]["kind"] == kind]


def criteria(trials: Sequence[Trial]) -> list[Row]:
    """All criteria, and further numbers."""
    single, pair, null, outside = (
        of_kind(trials, kind) for kind in ("single", "pair", "null", "outside")
    )
    cover = share("interval covers the truth", map(covered, single), least=90.0, most=98.0)
    return [
        share("right cause first, or a declared equivalent", map(right_first, single), least=90.0),
        share("exactly the right set", map(exact_set, single), least=85.0),
        share("false alarms", map(false_alarm, null), most=3.0),
        share("sure and wrong", map(sure_and_wrong, trials), most=3.0),
        share("outside the catalogue: seen, and nothing false", map(rejected, outside), least=90.0),
        share("pairs exact", map(exact_set, pair), least=75.0),
        cover,
        calibration(trials),
        share("... of the right ones, at the right place", map(right_location, single)),
        share("singles missed", (t["verdict"] == "nothing_wrong" for t in single)),
        share("singles unexplained", (t["verdict"] == "unexplained" for t in single)),
        share("singles partly named", (t["verdict"] == "partly_named" for t in single)),
        share("fault-free logs with a false name", (bool(t["causes"]) for t in null)),
        share("outside effects missed", (t["verdict"] == "nothing_wrong" for t in outside)),
        share("logs refused", (t["verdict"] == REFUSED for t in trials)),
        middle("time of a diagnosis, one process", (t["core_seconds"] for t in trials), "s"),
        middle("peak memory of the process", (t["memory"] for t in trials), "MB"),
    ]


def confidences(trials: Sequence[Trial]) -> tuple[Floats, Floats]:
    """Confidence of each named cause, and whether it is right, shape (k,) each."""
    pairs = []
    for trial in trials:
        false = false_names(trial)
        for cause in trial["causes"]:
            if cause["confidence"] is not None:
                pairs.append((cause["confidence"], cause not in false))
    return np.array([p for p, _ in pairs], float), np.array([r for _, r in pairs], float)


def calibration(trials: Sequence[Trial]) -> Row:
    """Expected calibration error of all confidences, in ten bins."""
    name, (confidence, right) = "expected calibration error", confidences(trials)
    if not len(confidence):
        return Row(name, 0, None, None, None, "", most=0.07)
    low, high = bootstrap_interval(expected_error, confidence, right, resamples=RESAMPLES)
    error = expected_error(confidence, right)
    return Row(name, len(confidence), error, low, high, "", most=0.07)


METRICS = {
    "right_first": "right cause first, or a declared equivalent",
    "exact_set": "exactly the right set",
    "false_alarms": "false alarms",
    "sure_and_wrong": "sure and wrong",
    "outside": "outside the catalogue: seen, and nothing false",
    "pairs_exact": "pairs exact",
    "coverage": "interval covers the truth",
    "calibration_error": "expected calibration error",
}
"""Rows that are metrics of the summary, by key."""


def metrics(rows: Sequence[Row]) -> dict[str, dict[str, object]]:
    """Metrics of the summary: threshold, value, and whether it is reached."""
    by_name = {row.name: row for row in rows}
    found: dict[str, dict[str, object]] = {}
    for key, name in METRICS.items():
        row = by_name[name]
        found[key] = {
            "must": row.must,
            "value": row.value,
            "interval": [row.low, row.high],
            "cases": row.cases,
            "unit": row.unit,
            "reached": row.reached,
        }
    return found
