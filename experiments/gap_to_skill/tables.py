"""Metrics and tables of gap to skill: errors with the maps of nominal and diagnosed model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.harness.report import Table
from experiments.harness.statistics import interval, metric, paired
from experiments.posture_accuracy.tables import WHEN, averages
from kengoro.visits import error_rows

NOMINAL, EXTENDED = "from-nominal", "from-diagnosis"
"""Conditions: the model that the map is trained on. The actual robot is the same in both."""

HALF = 0.5
"""Threshold of the share of the nominal error that is removed before the first update."""

MEASURES = {"rmse": "target_true_deg", "hand": "target_true_mm"}
"""RMSE_joint and Distance_hand, target against true."""

PerSeed = Mapping[int, Mapping[str, Any]]
"""`seed_entry` by seed and condition."""


def seed_entry(result: Mapping[str, Any]) -> dict[str, Any]:
    """Entry of one robot in one condition in the summary."""
    found = {when: averages(result[when], result["starts"]) for when in WHEN}
    return {**found, "diagnosis": result["diagnosis"]}


def of_robots(per_seed: PerSeed, key: str, condition: str, when: str) -> list[float]:
    """A number of `averages`, one for each robot."""
    return [entry[condition][when][key] for entry in per_seed.values()]


def shares_removed(per_seed: PerSeed, key: str) -> list[float]:
    """Share of the nominal error that a diagnosis removes before learning, one for each robot."""
    nominal, extended = (of_robots(per_seed, key, c, "before") for c in (NOMINAL, EXTENDED))
    return [1.0 - after / before for before, after in zip(nominal, extended, strict=True)]


def metrics(per_seed: PerSeed) -> dict[str, dict[str, Any]]:
    """Metrics of the experiment."""
    found = {}
    for name, key in MEASURES.items():
        unit = key.rpartition("_")[2]
        found[f"{name}_removed_before_learning"] = metric(
            shares_removed(per_seed, key), "", HALF, good="high"
        )
        for condition in (NOMINAL, EXTENDED):
            for when in WHEN:
                label = f"{name}_{when}_{condition.replace('-', '_')}"
                found[label] = metric(of_robots(per_seed, key, condition, when), unit)
    seconds = [entry[EXTENDED]["diagnosis"]["seconds"] for entry in per_seed.values()]
    found["diagnosis_time"] = metric(seconds, "s", 900.0)
    return found


def tables(per_seed: PerSeed) -> list[Table]:
    """Tables of all errors, of each robot, and of the diagnoses."""
    columns = {
        f"{condition}, {when}": [entry[condition][when] for entry in per_seed.values()]
        for condition in (NOMINAL, EXTENDED)
        for when in WHEN
    }
    return [
        Table(
            "Errors before and after online learning: mean over trials, median over robots (worst "
            "robot)",
            ("", *columns),
            error_rows(columns),
            " ".join((removed(per_seed), both(per_seed))),
        ),
        robot_table(per_seed),
        cause_table(per_seed),
    ]


def removed(per_seed: PerSeed) -> str:
    """Sentence on the share of the error that the diagnosis removes."""
    deg, mm = (interval(shares_removed(per_seed, key)) for key in MEASURES.values())
    return (
        f"Before the first online update the diagnosis removes a share of {deg} of RMSE_joint and "
        f"of {mm} of Distance_hand (target - true)."
    )


def both(per_seed: PerSeed) -> str:
    """Sentence on the errors after online learning from either model."""
    nominal, extended = (
        of_robots(per_seed, "target_true_deg", c, "after") for c in (NOMINAL, EXTENDED)
    )
    gap = paired(extended, nominal)
    return (
        "After online learning the error with the diagnosed model minus that with the nominal one "
        f"is {gap} deg."
    )


def robot_table(per_seed: PerSeed) -> Table:
    """Table of target - true by robot."""
    rows = []
    for seed, entry in per_seed.items():
        cells = [
            " -> ".join(f"{entry[condition][when][key]:.1f}" for when in WHEN)
            for key in MEASURES.values()
            for condition in (NOMINAL, EXTENDED)
        ]
        rows.append((seed, *cells))
    units = [key.rpartition("_")[2] for key in MEASURES.values()]
    names = [f"{c} [{unit}]" for unit in units for c in (NOMINAL, EXTENDED)]
    return Table(
        "Each robot: target - true, before -> after online learning",
        ("robot", *names),
        rows,
        "Means over trials; mm is Distance_hand.",
    )


def cause_table(per_seed: PerSeed) -> Table:
    """Table of the diagnoses."""
    rows = []
    for seed, entry in per_seed.items():
        found = entry[EXTENDED]["diagnosis"]
        causes = ", ".join(f"{c['cause']} ({c['parameters']})" for c in found["causes"]) or "none"
        gain = "-" if found["gain"] is None else f"{found['gain']:.2f}"
        rms = f"{found['rms_before']:.1f} -> {found['rms_after']:.1f}"
        rows.append((seed, found["verdict"], causes, rms, gain, f"{found['seconds']:.0f}"))
    return Table(
        "Diagnoses",
        ("robot", "verdict", "causes (parameters)", "residual [noises]", "gain", "time [s]"),
        rows,
        "Residual: on the split of the log for the report.",
    )
