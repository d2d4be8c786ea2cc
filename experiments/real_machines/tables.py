"""Tables and metrics of the measured machines."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.harness.report import Table
from experiments.real_machines.trial import CALIBRATED, EXTENDED, NOMINAL, PUBLISHED

LEAST = 1e-6
"""Size of a parameter in SI units below which it counts as 0."""
COLUMNS = (NOMINAL, EXTENDED, CALIBRATED, PUBLISHED)
"""Models that are compared beside the baselines."""
MOST, HALF = 1.05, 0.5
"""Largest ratio of the held-out error to that of the best baseline; share of machines on which it
must be below 1."""


def metrics(done: Mapping[str, Any]) -> dict[str, dict[str, object]]:
    """Metrics of the summary: ratio of held-out errors of each machine, and how often it wins."""
    found: dict[str, dict[str, object]] = {
        f"ratio_{name}": {
            "must": f"at most {MOST:g}",
            "value": result["ratio"],
            "unit": "1",
            "reached": result["ratio"] <= MOST,
        }
        for name, result in done.items()
    }
    share = sum(result["ratio"] < 1.0 for result in done.values()) / len(done)
    found["below_best_baseline"] = {
        "must": f"at least {HALF:g}",
        "value": share,
        "unit": "of machines",
        "reached": share >= HALF,
    }
    return found


def tables(done: Mapping[str, Any], skipped: Mapping[str, str]) -> list[Table]:
    """All tables of the report."""
    found = [error_table(done), cause_table(done), attempt_table(done), baseline_table(done)]
    if skipped:
        found.append(Table("Left out", ("machine", "reason"), list(skipped.items())))
    return found


def error_table(done: Mapping[str, Any]) -> Table:
    """Table of the held-out errors of each channel."""
    rows: list[tuple[object, ...]] = []
    baselines = tuple(
        dict.fromkeys(title for result in done.values() for title in result["baselines"])
    )
    for result in done.values():
        for channel in result["errors"][NOMINAL]:
            if channel == "all":
                continue
            errors = [result["errors"].get(key, {}).get(channel) for key in COLUMNS + baselines]
            rows.append(
                (
                    result["title"],
                    channel,
                    f"{result['seconds']:.1f}",
                    result["verdict"],
                    *("" if error is None else f"{error:.3g}" for error in errors),
                    f"{result['ratio']:.2f}",
                    "" if result["calibrated"] is None else f"{result['calibrated']:.2f}",
                )
            )
    head = ("machine", "channel", "log [s]", "verdict", *COLUMNS, *baselines, "ratio", "calibrated")
    note = (
        "RMS errors on held-out readings in the unit of the channel. Ratio: of the error with the "
        f"named causes to that of the best baseline, over all channels; at most {MOST:g} is "
        "needed. Calibrated: the same of the calibrated model, if there is one."
    )
    return Table("Held-out errors", head, rows, note)


def cause_table(done: Mapping[str, Any]) -> Table:
    """Table of the named causes."""
    rows = [
        (
            result["title"],
            f"{cause['cause']} at {cause['location']}: {name}",
            f"{e['value']:.4g}",
            f"{e['low']:.4g} to {e['high']:.4g}",
            e["unit"],
            f"{cause['confidence']:.2f}",
            ", ".join(cause["equivalent"]),
        )
        for result in done.values()
        for cause in result["causes"]
        for name, e in cause["parameters"].items()
    ]
    head = ("machine", "cause", "value", "95 % interval", "unit", "confidence", "equivalent")
    return Table("Named causes", head, rows)


def attempt_table(done: Mapping[str, Any]) -> Table:
    """Table of the causes of the best attempts that are not named."""
    rows = [
        (
            result["title"],
            f"{one['cause']} at {one['location']}",
            ", ".join(f"{name} {_number(value)}" for name, value in one["values"].items()),
            one["reason"],
        )
        for result in done.values()
        for one in result["rejected"]
    ]
    return Table("Fitted and not named", ("machine", "cause", "values", "it ..."), rows)


def baseline_table(done: Mapping[str, Any]) -> Table:
    """Table of the baselines' parameters."""
    rows = [
        (
            result["title"],
            title,
            ", ".join(f"{name} {x:.3g}" for name, x in values.items() if abs(x) >= LEAST),
        )
        for result in done.values()
        for title, values in result["baselines"].items()
    ]
    note = "SI units; mass and gain are relative errors of the nominal model. Zeros are left out."
    return Table("Parameters of the baselines", ("machine", "baseline", "values"), rows, note)


def _number(value: float) -> str:
    """Return a parameter with three digits, and 0 for one that rounding keeps from being 0."""
    return "0" if abs(value) < LEAST else f"{value:.3g}"
