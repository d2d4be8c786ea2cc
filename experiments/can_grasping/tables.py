"""Metrics and tables of the can-grasping experiment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scipy.stats import binomtest

from experiments.harness.report import Table
from experiments.harness.statistics import metric
from experiments.robots.conditions import NOMINAL
from kengoro.grasp_trial import outcome_sentences
from kengoro.visits import error_rows

PerSeed = Mapping[Any, Mapping[str, Any]]
"""Summary of each robot, with that of the robot without departures as entry `NOMINAL`."""

JUDGED = {
    "rmse_seen": ("estimate_seen_deg", "deg"),
    "rmse_true": ("target_true_deg", "deg"),
    "hand_true": ("target_true_mm", "mm"),
    "max_tension": ("max_tension_N", "N"),
}
"""Keys of `visits.errors` that are evaluated before and after learning, with units."""


def share(yes: Sequence[bool], must: float | None = None, paper: str | None = None) -> Any:
    """Metric of a share of robots, with its Wilson 95 % interval.

    A bootstrap interval would have no width where all robots have the same outcome.
    """
    found = metric([sum(yes) / len(yes)], "of robots", must, paper, good="high")
    low, high = binomtest(sum(yes), len(yes)).proportion_ci(method="wilson")
    return {**found, "worst": float(min(yes)), "low": round(low, 3), "high": round(high, 3)}


def metrics(per_seed: PerSeed) -> dict[str, dict[str, Any]]:
    """Metrics; those that no robot has are left out."""
    robots = list(per_seed.values())
    nominal = [robot[NOMINAL] for robot in robots]
    result = {
        "grasped_before": share([r["grasped_before"] for r in robots], paper="misses"),
        "grasped_after": share([r["grasped_after"] for r in robots], 0.9, "grasps"),
    }
    for end, number in (("first", 0), ("last", -1)):
        for name, trials in (("", robots), ("_nominal", nominal)):
            off = [t["approaches"][number]["hand_distance_mm"] for t in trials if t["approaches"]]
            if off:
                result[f"hand_{end}_approach{name}"] = metric(off, "mm")
    for name, (key, unit) in JUDGED.items():
        for when in ("before", "after"):
            values = [r[when][key] for r in robots if key in r[when]]
            if values:
                result[f"{name}_{when}"] = metric(values, unit)
    result["jmm_change_mm"] = metric([r["jmm_change_mm"] for r in robots], "mm", paper=15.0)
    result["postures_learned"] = metric([float(r["postures"]) for r in robots], "")
    result["grasped_first_nominal"] = share([d["grasped_at_first_approach"] for d in nominal])
    result["grasped_after_nominal"] = share([d["grasped_after"] for d in nominal])
    return result


def tables(per_seed: PerSeed) -> list[Table]:
    """Tables of the approaches, and of errors and tensions before and after learning."""
    columns = {when: [robot[when] for robot in per_seed.values()] for when in ("before", "after")}
    errors = Table(
        "Errors and tensions at test postures: median over robots (worst robot)",
        ("", *columns),
        error_rows(columns),
        "Postures that are never learned from, with learning off; medians over each robot's "
        "postures. " + fall(per_seed),
    )
    return [outcome_table(per_seed), errors]


def fall(per_seed: PerSeed) -> str:
    """Sentence on the number of robots with lower errors and tensions after learning."""
    parts = []
    for name, (key, _) in JUDGED.items():
        both = [(r["before"], r["after"]) for r in per_seed.values()]
        pairs = [(b[key], a[key]) for b, a in both if key in b and key in a]
        parts.append(f"{name} on {sum(a < b for b, a in pairs)} of {len(pairs)}")
    return f"Lower after than before: {', '.join(parts)} robots."


def outcome_table(per_seed: PerSeed) -> Table:
    """Table of the approaches of each robot."""
    head = [
        "robot",
        "distance of hand from target [mm]",
        "largest tension [N]",
        "grasped",
        "control grasps",
        "postures",
        "nominal: distance of hand from target [mm]",
    ]
    rows: list[Sequence[object]] = []
    for seed, result in per_seed.items():
        control = result["grasped_before_from_the_last_target"]
        rows.append(
            [
                seed,
                _distances(result),
                ", ".join(f"{a['max_tension_N']:.0f}" for a in result["approaches"]),
                "yes" if result["grasped_after"] else "no",
                "yes" if control else "no",
                result["postures"],
                _distances(result[NOMINAL]),
            ]
        )
    robots = per_seed.values()
    note = (
        f"Grasped before learning: {sum(r['grasped_before'] for r in robots)} of {len(robots)}, "
        f"{sum(r['grasped_at_first_approach'] for r in robots)} of them at the first approach; "
        f"after: {sum(r['grasped_after'] for r in robots)}. * marks an approach that lifted the "
        "can. Control: the map before learning, with the IK target of the last approach. Nominal: "
        "the robot without departures, where the map is exact and the first approach shows the sag "
        "under gravity. Intervals of shares of robots are Wilson intervals."
    )
    return Table("Approaches", head, rows, note)


def _distances(result: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{a['hand_distance_mm']:.0f}{'*' if a['grasped'] else ''}" for a in result["approaches"]
    )


def closing(robot: Mapping[str, Any]) -> str:
    """Result of the only robot of a run, in three sentences."""
    approaches = robot["approaches"]
    sentences = outcome_sentences(
        [1e-3 * approach["hand_distance_mm"] for approach in approaches],
        [approach["grasped"] for approach in approaches],
        robot["updates"]["vision"],
        approaches[-1]["start_s"] - approaches[0]["start_s"] if approaches else 0.0,
    )
    return " ".join([*sentences, *robot["notes"]])
