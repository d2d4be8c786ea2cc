"""Tables of the can-grasping experiment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from experiments.common import median_and_worst
from experiments.report import Table

MEASURED = {
    "rmse_joint_deg": "RMSE_joint, target against true [deg]",
    "rmse_joint_seen_deg": "RMSE_joint, estimate against seen [deg]",
    "estimate_true_deg": "RMSE_joint, estimate against true [deg]",
    "estimate_target_deg": "RMSE_joint, estimate against target [deg]",
    "hand_target_true_mm": "hand, target against true [mm]",
    "hand_estimate_true_mm": "hand, estimate against true [mm]",
    "max_tension_N": "largest tension [N]",
}
"""What is measured on test postures before and after."""


def medians_and_worst(per_seed: Mapping[int, Mapping[str, Any]]) -> dict[str, Any]:
    """Medians and worst over the robots."""
    results = list(per_seed.values())
    medians: dict[str, Any] = {
        "grasped_before": sum(bool(r["grasped_before"]) for r in results),
        "grasped_after": sum(bool(r["grasped_after"]) for r in results),
        "robots": len(results),
    }
    for key in MEASURED:
        medians[key] = {
            when: median_and_worst(r[key][when] for r in results if r[key][when] is not None)
            for when in ("before", "after")
        }
    reached = [r["approaches"] for r in results if r["approaches"]]
    for name, index in (("first", 0), ("last", -1)):
        medians[f"hand_distance_{name}_approach_mm"] = median_and_worst(
            approaches[index]["hand_distance_mm"] for approaches in reached
        )
    return medians


def outcome_table(per_seed: Mapping[int, Mapping[str, Any]]) -> Table:
    """How each robot's approaches went."""
    head = ["robot", "approach: hand off target [mm]", "grasped", "control grasps", "postures"]
    rows: list[Sequence[object]] = []
    for seed, result in per_seed.items():
        distances = ", ".join(
            f"{a['hand_distance_mm']:.0f}{'*' if a['grasped'] else ''}"
            for a in result["approaches"]
        )
        control = result["grasped_before_from_the_last_target"]
        after = "yes" if result["grasped_after"] else "no"
        rows.append([seed, distances, after, "yes" if control else "no", result["postures"]])
    before = sum(bool(r["grasped_before"]) for r in per_seed.values())
    after_all = sum(bool(r["grasped_after"]) for r in per_seed.values())
    note = (
        f"Grasped before learning: {before} of {len(per_seed)}; after: {after_all} of "
        f"{len(per_seed)}. * marks an approach that lifted the can. The control is the map before "
        "learning, sent to the IK target of the last approach."
    )
    return Table("Approaches", head, rows, note)


def error_table(per_seed: Mapping[int, Mapping[str, Any]]) -> Table:
    """Errors and tensions before and after, median and worst over the robots."""
    medians = medians_and_worst(per_seed)
    rows = []
    for key, name in MEASURED.items():
        before, after = medians[key]["before"], medians[key]["after"]
        cells = [_cell(x) for x in (*before.values(), *after.values())]
        rows.append([name, *cells])
    for name in ("first", "last"):
        spread = medians[f"hand_distance_{name}_approach_mm"]
        cells = [_cell(x) for x in spread.values()]
        row = [*cells, "", ""] if name == "first" else ["", "", *cells]
        rows.append([f"hand off its target, {name} approach [mm]", *row])
    head = ["", "before: median", "worst", "after: median", "worst"]
    note = "On postures that were not learned, learning off; medians over each robot's postures."
    return Table("Errors and tensions, before and after", head, rows, note)


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"
