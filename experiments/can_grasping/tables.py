"""Numbers and tables of the can-grasping experiment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scipy.stats import binomtest

from experiments.harness.report import Table
from experiments.harness.statistics import metric
from kengoro.arm import NOMINAL
from kengoro.visits import error_rows

PerSeed = Mapping[Any, Mapping[str, Any]]
"""The summary of each robot, that of the robot without departures as ``drawing``."""

JUDGED = {
    "rmse_seen": ("estimate_seen_deg", "deg"),
    "rmse_true": ("target_true_deg", "deg"),
    "hand_true": ("target_true_mm", "mm"),
    "max_tension": ("max_tension_N", "N"),
}
"""Of `visits.errors`: what is judged before and after, and its unit."""


def share(yes: Sequence[bool], must: float | None = None, paper: str | None = None) -> Any:
    """A metric that is a share of robots, with its Wilson 95 % interval in place of the
    bootstrap's, which is of no width where all robots are alike."""
    found = metric([sum(yes) / len(yes)], "of robots", must, paper, good="high")
    low, high = binomtest(sum(yes), len(yes)).proportion_ci(method="wilson")
    return {**found, "worst": float(min(yes)), "low": round(low, 3), "high": round(high, 3)}


def metrics(per_seed: PerSeed) -> dict[str, dict[str, Any]]:
    """Numbers that the experiment is judged by; one that no robot has is left out."""
    robots = list(per_seed.values())
    drawn = [robot[NOMINAL] for robot in robots]
    result = {
        "grasped_before": share([r["grasped_before"] for r in robots], paper="misses"),
        "grasped_after": share([r["grasped_after"] for r in robots], 0.9, "grasps"),
    }
    for end, number in (("first", 0), ("last", -1)):
        for name, trials in (("", robots), ("_nominal", drawn)):
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
    result["grasped_first_nominal"] = share([d["grasped_at_first_approach"] for d in drawn])
    result["grasped_after_nominal"] = share([d["grasped_after"] for d in drawn])
    return result


def tables(per_seed: PerSeed) -> list[Table]:
    """How each robot's approaches went; errors and tensions before and after."""
    columns = {when: [robot[when] for robot in per_seed.values()] for when in ("before", "after")}
    errors = Table(
        "Errors and tensions at test postures: median over robots (worst robot)",
        ("", *columns),
        error_rows(columns),
        "At postures that were not learned from, learning off; medians over each robot's postures. "
        + fall(per_seed),
    )
    return [outcome_table(per_seed), errors]


def fall(per_seed: PerSeed) -> str:
    """On how many robots the errors and tensions fell."""
    told = []
    for name, (key, _) in JUDGED.items():
        both = [(r["before"], r["after"]) for r in per_seed.values()]
        pairs = [(b[key], a[key]) for b, a in both if key in b and key in a]
        told.append(f"{name} on {sum(a < b for b, a in pairs)} of {len(pairs)}")
    return f"Lower after than before: {', '.join(told)} robots."


def outcome_table(per_seed: PerSeed) -> Table:
    """How each robot's approaches went."""
    head = [
        "robot",
        "approach: hand off target [mm]",
        "largest tension [N]",
        "grasped",
        "control grasps",
        "postures",
        "as drawn: hand off target [mm]",
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
        "can. The control is the map before learning, sent to the IK target of the last approach. "
        "As drawn: the same without departures, where the map is right from the beginning and the "
        "first approach shows what gravity does. Intervals of shares of robots are Wilson's."
    )
    return Table("Approaches", head, rows, note)


def _distances(result: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{a['hand_distance_mm']:.0f}{'*' if a['grasped'] else ''}" for a in result["approaches"]
    )
