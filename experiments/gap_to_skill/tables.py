"""Numbers and tables of gap to skill: what a diagnosis leaves of the drawing's error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.harness.report import Table
from experiments.harness.statistics import interval, metric, paired
from experiments.posture_accuracy.tables import WHEN, averages
from kengoro.visits import error_rows

DRAWN, EXTENDED = "from-nominal", "from-diagnosis"
"""The conditions: the model that the map is trained on. The robot is the same actual one."""

HALF = 0.5
"""Share of the drawing's error that must be gone before the first online update."""

MEASURES = {"rmse": "target_true_deg", "hand": "target_true_mm"}
"""RMSE_joint and Distance_hand, target against true."""

PerSeed = Mapping[int, Mapping[str, Any]]
"""`seed_entry` by seed and condition."""


def seed_entry(result: Mapping[str, Any]) -> dict[str, Any]:
    """What is told of one robot in one condition."""
    found = {when: averages(result[when], result["starts"]) for when in WHEN}
    return {**found, "diagnosis": result["diagnosis"]}


def of_robots(per_seed: PerSeed, key: str, condition: str, when: str) -> list[float]:
    """A number of `averages`, one a robot."""
    return [entry[condition][when][key] for entry in per_seed.values()]


def shares_gone(per_seed: PerSeed, key: str) -> list[float]:
    """What share of the drawing's error a diagnosis takes away before learning, one a robot."""
    drawn, left = (of_robots(per_seed, key, c, "before") for c in (DRAWN, EXTENDED))
    return [1.0 - after / before for before, after in zip(drawn, left, strict=True)]


def metrics(per_seed: PerSeed) -> dict[str, dict[str, Any]]:
    """Numbers that the experiment is judged by."""
    found = {}
    for name, key in MEASURES.items():
        unit = key.rpartition("_")[2]
        found[f"{name}_gone_before_learning"] = metric(
            shares_gone(per_seed, key), "", HALF, good="high"
        )
        for condition in (DRAWN, EXTENDED):
            for when in WHEN:
                label = f"{name}_{when}_{condition.replace('-', '_')}"
                found[label] = metric(of_robots(per_seed, key, condition, when), unit)
    seconds = [entry[EXTENDED]["diagnosis"]["seconds"] for entry in per_seed.values()]
    found["diagnosis_time"] = metric(seconds, "s", 900.0)
    return found


def tables(per_seed: PerSeed) -> list[Table]:
    """All errors, each robot, and what was found on it."""
    columns = {
        f"{condition}, {when}": [entry[condition][when] for entry in per_seed.values()]
        for condition in (DRAWN, EXTENDED)
        for when in WHEN
    }
    return [
        Table(
            "Errors before and after online learning: mean over trials, median over robots (worst "
            "robot)",
            ("", *columns),
            error_rows(columns),
            " ".join((gone(per_seed), both(per_seed))),
        ),
        robot_table(per_seed),
        cause_table(per_seed),
    ]


def gone(per_seed: PerSeed) -> str:
    """What the diagnosis takes away."""
    deg, mm = (interval(shares_gone(per_seed, key)) for key in MEASURES.values())
    return (
        f"Before the first online update the diagnosis has taken away a share of {deg} of "
        f"RMSE_joint and of {mm} of Distance_hand, target against true."
    )


def both(per_seed: PerSeed) -> str:
    """What online learning reaches from either model."""
    drawn, extended = (
        of_robots(per_seed, "target_true_deg", c, "after") for c in (DRAWN, EXTENDED)
    )
    gap = paired(extended, drawn)
    return f"After online learning the diagnosed model is {gap} deg from what the drawing reaches."


def robot_table(per_seed: PerSeed) -> Table:
    """Each robot, target against true."""
    rows = []
    for seed, entry in per_seed.items():
        cells = [
            " -> ".join(f"{entry[condition][when][key]:.1f}" for when in WHEN)
            for key in MEASURES.values()
            for condition in (DRAWN, EXTENDED)
        ]
        rows.append((seed, *cells))
    names = [f"{c} [{k.rpartition('_')[2]}]" for k in MEASURES.values() for c in (DRAWN, EXTENDED)]
    return Table(
        "Each robot: target - true, before -> after online learning",
        ("robot", *names),
        rows,
        "Means over trials; mm is Distance_hand.",
    )


def cause_table(per_seed: PerSeed) -> Table:
    """What was found on each robot."""
    rows = []
    for seed, entry in per_seed.items():
        told = entry[EXTENDED]["diagnosis"]
        causes = ", ".join(f"{c['cause']} ({c['parameters']})" for c in told["causes"]) or "none"
        gain = "-" if told["gain"] is None else f"{told['gain']:.2f}"
        rms = f"{told['rms_before']:.1f} -> {told['rms_after']:.1f}"
        rows.append((seed, told["verdict"], causes, rms, gain, f"{told['seconds']:.0f}"))
    return Table(
        "Diagnoses",
        ("robot", "verdict", "causes (parameters)", "residual [noises]", "gain", "time [s]"),
        rows,
        "Residual: on the part of the log that is kept for the report.",
    )
