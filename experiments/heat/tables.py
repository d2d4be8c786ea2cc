"""Tables and metrics of heat."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.harness.experiment import Results
from experiments.harness.report import Table
from experiments.harness.statistics import interval, metric
from jmm_agent.heat.parameters import HeatOptions

HEALTHY, FAULTS, POSTURES, WHOLE = "healthy", "faults", "postures", "whole"
"""Conditions: plans on healthy motors and with faults, warm postures, and hours in full."""
RATIO = 1.3
"""Largest posture error with the limit over that without."""
MINUTES = 10.0
"""Longest time until a change is named [min]."""
VISIBLE = ("housing_to_ambient", "heat_per_tension")
"""Parameters whose change the temperature of the housing shows soon."""
RISE = 15.0
"""Rise of a housing over its surroundings from which on its changes must be named [K]."""


def _strict(values: list[float], unit: str, must: float) -> Mapping[str, Any]:
    """A metric that the worst robot must satisfy, too."""
    return metric(values, unit, must, by="worst")


def changes(results: Results) -> list[dict[str, Any]]:
    """All changes of parameters on all robots."""
    return [change for result in results.values() for change in result[FAULTS]["changes"]]


def metrics(results: Results) -> dict[str, Mapping[str, Any]]:
    """What must be reached, and what belongs to it."""
    healthy = [result[HEALTHY] for result in results.values()]
    postures = [result[POSTURES] for result in results.values()]
    whole = [result[WHOLE] for result in results.values() if result[WHOLE]]
    limit = HeatOptions().limit
    faulty = [max(c["hottest"] for c in result[FAULTS]["changes"]) for result in results.values()]
    found: dict[str, Mapping[str, Any]] = {
        "highest_core": _strict([one["hottest"] for one in healthy], "degC", limit),
        "highest_core_with_faults": _strict(faulty, "degC", limit),
        "highest_core_without_limit": metric(
            [one["hottest_without_limit"] for one in healthy], "degC"
        ),
        "core_error_by_data_sheet": metric([one["error_nominal_K"] for one in healthy], "K"),
        "core_error_first_20_min": metric([one["error_first_K"] for one in healthy], "K"),
        "core_error_learned": metric([one["error_learned_K"] for one in healthy], "K"),
        "core_inside_interval": metric([100 * one["inside"] for one in healthy], "%", good="high"),
        "false_names": _strict([float(one["false_names"]) for one in healthy], "", 0.0),
        "posture_error_ratio": metric(
            [p["limited"]["error_deg"] / p["free"]["error_deg"] for p in postures], "", RATIO
        ),
        "highest_core_in_full": _strict([p["limited"]["hottest"] for p in postures], "degC", limit),
    }
    if whole:
        found["highest_core_of_hours_in_full"] = _strict(
            [one["hottest"] for one in whole], "degC", limit
        )
    for parameter in VISIBLE:
        warm = [c for c in changes(results) if c["parameter"] == parameter and c["rise_K"] >= RISE]
        named = [c["minutes"] for c in warm if c["minutes"] is not None]
        if not warm:
            continue
        share = 100.0 * len([minutes for minutes in named if minutes <= MINUTES]) / len(warm)
        found[f"named_in_time_{parameter}"] = metric([share], "%", 100.0, good="high")
        if named:
            found[f"minutes_{parameter}"] = metric(named, "min", MINUTES)
    return found


def tables(results: Results) -> list[Table]:
    """All tables of the report."""
    rows = []
    for seed, result in results.items():
        one, posture = result[HEALTHY], result[POSTURES]
        rows.append(
            (
                seed,
                f"{one['hottest']:.1f}",
                f"{one['hottest_without_limit']:.1f}",
                f"{one['error_nominal_K']:.1f}",
                f"{one['error_learned_K']:.1f}",
                one["false_names"],
                f"{posture['limited']['error_deg']:.2f}",
                f"{posture['free']['error_deg']:.2f}",
                f"{posture['free']['hottest']:.1f}",
            )
        )
    head = (
        "robot",
        "core [degC]",
        "without limit",
        "error by data sheet [K]",
        "learned [K]",
        "false names",
        "posture error [deg]",
        "without limit",
        "core without limit [degC]",
    )
    note = (
        "Highest core of any motor in three hours, its error (RMS over the last hour, motors 20 K "
        "above their surroundings); last three columns: postures with warm motors, in full."
    )
    return [Table("Robots", head, rows, note), _change_table(results)]


def _change_table(results: Results) -> Table:
    rows: list[tuple[object, ...]] = []
    kinds = dict.fromkeys((c["parameter"], c["factor"]) for c in changes(results))
    for parameter, factor in kinds:
        for warm in (True, False):
            these = [
                c
                for c in changes(results)
                if (c["parameter"], c["factor"]) == (parameter, factor)
                and (c["rise_K"] >= RISE) is warm
            ]
            if not these:
                continue
            named = [c for c in these if c["minutes"] is not None]
            time = str(interval([c["minutes"] for c in named])) if named else ""
            worst = f"{max(c['minutes'] for c in named):.1f}" if named else ""
            right = sum(bool(c["right"]) for c in named)
            alone = sum(bool(c["alone"]) for c in named)
            label = f"{parameter} x {factor:g}"
            rise = f"{'at least' if warm else 'below'} {RISE:g}"
            rows.append((label, rise, len(these), len(named), time, worst, right, alone))
    head = ("change", "rise [K]", "motors", "named", "minutes", "worst", "right", "right alone")
    note = (
        "Rise: of the housing over its surroundings at the change. Right: the parameter is among "
        "those that are named; alone: no other is named beside it."
    )
    return Table("Changes of parameters after an hour", head, rows, note)
