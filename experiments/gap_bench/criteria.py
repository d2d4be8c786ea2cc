"""Criteria of the diagnosis: numbers with 95 % intervals, and their thresholds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from experiments.gap_bench.scores import (
    AMBIGUOUS,
    NOTHING,
    UNEXPLAINED,
    Trial,
    added_mass_error,
    entropy,
    exact_set,
    first_name,
    gain_ratio,
    parameter_error,
    right_first,
    right_location,
    right_or_equivalent,
    truth,
)
from experiments.harness.criteria import Row, expected_error, middle, share
from experiments.harness.statistics import bootstrap_interval
from jmm_agent.types import Floats

RESAMPLES = 2000
"""Number of bootstrap samples of means and calibration errors."""
LIMIT = 60.0
"""Longest acceptable time of a diagnosis of 20 s of the elbow [s]."""
ERRORS = {
    "mass": (3.0, "%"),
    "friction": (15.0, "%"),
    "stiffness": (30.0, "%"),
    "delay": (1.0, "samples"),
    "moved sites": (1.0, "mm"),
}
"""Largest acceptable median error, and its unit, by family of parameters."""


def musts(trials: Sequence[Trial]) -> list[Row]:
    """All criteria, and further numbers."""
    single, pair, null, outside = (
        [t for t in trials if t["case"]["kind"] == kind]
        for kind in ("single", "pair", "null", "outside")
    )
    return [
        share("right cause first", map(right_first, single), least=90.0),
        share("right cause or a declared equivalent", map(right_or_equivalent, single), least=97.0),
        share("right muscle, joint or sensor", map(right_location, single), least=90.0),
        share("... or one declared equivalent", (right_location(t, True) for t in single)),
        share(
            "... of those with the right cause", map(right_location, filter(right_first, single))
        ),
        share("singles with a second cause named", (len(t["causes"]) > 1 for t in single)),
        share(
            "false alarms on fault-free logs", (first_name(t) != NOTHING for t in null), most=5.0
        ),
        share(
            "outside effects called unexplained",
            (first_name(t) == UNEXPLAINED for t in outside),
            least=80.0,
        ),
        share(
            "singles called unexplained", (first_name(t) == UNEXPLAINED for t in single), most=5.0
        ),
        share("singles missed", (first_name(t) == NOTHING for t in single)),
        share("two causes, exact set", map(exact_set, pair), least=70.0),
        share("... with declared equivalents", (exact_set(t, True) for t in pair)),
        *_errors(single),
        _equivalents(trials),
        calibration_error(trials),
        middle("gain over that of the true model", map(_percent, single + pair), "%", least=80.0),
        *_after(single),
        share(
            f"diagnosed within {LIMIT:.0f} s by one process", (t["seconds"] < LIMIT for t in trials)
        ),
        middle("time of a diagnosis, one process", (t["seconds"] for t in trials), "s"),
        _worst("longest diagnosis", [t["seconds"] for t in trials], "s"),
    ]


def _percent(trial: Trial) -> float | None:
    ratio = gain_ratio(trial)
    return None if ratio is None else 100 * ratio


def _errors(single: Sequence[Trial]) -> list[Row]:
    found = [e for e in map(parameter_error, single) if e is not None]
    rows = [
        middle(f"error: {family}", (e for f, e in found if f == family), unit, most=most)
        for family, (most, unit) in ERRORS.items()
    ]
    return [
        *rows,
        middle("error: mass, relative to the added mass", map(added_mass_error, single), "%"),
    ]


def _equivalents(trials: Sequence[Trial]) -> Row:
    counts = [float(len(c["equivalent"])) for t in trials for c in t["causes"]]
    return _mean("declared equivalents of a named cause, mean", counts, "", most=0.5)


def _mean(name: str, values: Sequence[float], unit: str, **must: float) -> Row:
    if not values:
        return Row(name, 0, None, None, None, unit, **must)
    numbers = np.array(values)
    low, high = bootstrap_interval(np.mean, numbers, resamples=RESAMPLES)
    return Row(name, len(values), float(numbers.mean()), low, high, unit, **must)


def _worst(name: str, values: Sequence[float], unit: str) -> Row:
    return Row(name, len(values), max(values, default=None), None, None, unit)


def confidences(trials: Sequence[Trial]) -> tuple[Floats, Floats]:
    """Confidence of each named cause, and whether it is true, shape (k,) each."""
    pairs = [
        (c["confidence"], c["cause"] in {e["cause"] for e in t["truth"]})
        for t in trials
        for c in t["causes"]
    ]
    return np.array([p for p, _ in pairs], float), np.array([r for _, r in pairs], float)


def calibration_error(trials: Sequence[Trial]) -> Row:
    """Expected calibration error of all confidences."""
    name, (confidence, right) = "confidence, expected calibration error", confidences(trials)
    if not len(confidence):
        return Row(name, 0, None, None, None, "", most=0.10)
    low, high = bootstrap_interval(expected_error, confidence, right, resamples=RESAMPLES)
    return Row(name, len(confidence), expected_error(confidence, right), low, high, "", most=0.10)


def _after(single: Sequence[Trial]) -> list[Row]:
    """Criteria of the suggested experiments, if there are any."""
    done = [t for t in single if t["followup"] is not None]
    if not done:
        return []
    halved = []
    for t in done:
        before, after = entropy(t), entropy({**t["followup"], "truth": t["truth"]})
        halved.append(before is not None and after is not None and after <= 0.5 * before)
    then = (first_name(t["followup"]) == truth(t) for t in done)
    doubts = [t for t in single if (entropy(t) or 0.0) > AMBIGUOUS]
    advised = (t["followup"] is not None for t in doubts)
    return [
        share(f"an experiment is advised where entropy > {AMBIGUOUS:g} nats", advised),
        share("entropy halved by the suggested experiment", halved, least=80.0),
        share("right first before the suggested experiment", map(right_first, done)),
        share("... after it", then),
    ]
