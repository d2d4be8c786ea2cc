"""Tables and metrics of snapped muscles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.harness.experiment import Results
from experiments.harness.report import Table
from experiments.harness.statistics import metric
from experiments.robots.conditions import ACTUAL
from jmm_agent.guard.faults import MotorControl

MUST_RATIO = 2.0
"""Largest error of postures that can be held, over that of the same postures before [1]."""
LIMIT = MotorControl().limit + 1e-3
"""Largest tension that commands may demand, with a margin for rounding [N]."""

Visits = Sequence[Mapping[str, Any]]


def held(before: Visits, after: Visits) -> tuple[list[float], list[float]]:
    """Errors [deg] before and after at the postures that can be held by the balance."""
    both = [pair for pair in zip(before, after, strict=True) if pair[1]["held"]]
    return [one["wanted_deg"] for one, _ in both], [two["wanted_deg"] for _, two in both]


def ratio(robot: Mapping[str, Any], key: str) -> float | None:
    """Error over that before, postures that can be held of all muscles; None if there are none."""
    before: list[float] = []
    after: list[float] = []
    for muscle in robot["muscles"]:
        one, two = held(robot["before"], muscle[key])
        before, after = before + one, after + two
    return float(np.median(after) / np.median(before)) if before else None


def _of_one(robot: Mapping[str, Any], muscle: Mapping[str, Any]) -> float | None:
    """`ratio` after learning, of one muscle."""
    return ratio({"before": robot["before"], "muscles": [muscle]}, "learned")


def named_joints(robot: Mapping[str, Any]) -> list[bool]:
    """Whether the joint was named that lacks most torque on the actual robot, where one was."""
    visited = [
        one for muscle in robot["muscles"] for key in ("after", "learned") for one in muscle[key]
    ]
    return [one["named"] == one["lacks"] for one in visited if one["named"] is not None]


def agreement(robot: Mapping[str, Any]) -> list[bool]:
    """Whether agent and actual robot agree that a posture can be held."""
    visited = [
        one for muscle in robot["muscles"] for key in ("after", "learned") for one in muscle[key]
    ]
    return [(one["named"] is None) == (one["lacks"] is None) for one in visited]


def nearest(robot: Mapping[str, Any]) -> list[float]:
    """|target - true| [deg] where the arm went to the nearest posture that can be held."""
    return [
        one["target_deg"]
        for muscle in robot["muscles"]
        for one in muscle["learned"]
        if one["named"] is not None
    ]


def metrics(results: Results) -> dict[str, Mapping[str, Any]]:
    """What must be reached, and what is shown beside it."""
    robots = [result[ACTUAL] for result in results.values()]
    muscles = [list(robot["muscles"]) for robot in robots]
    found: dict[str, Mapping[str, Any]] = {}
    for key, must in (("unnoticed", None), ("after", None), ("learned", MUST_RATIO)):
        ratios = [value for robot in robots if (value := ratio(robot, key)) is not None]
        if ratios:
            found[f"error_{key}_over_before"] = metric(ratios, "", must=must)
    worst = [
        max((value for one in own if (value := _of_one(robot, one)) is not None), default=None)
        for robot, own in zip(robots, muscles, strict=True)
    ]
    if any(value is not None for value in worst):
        name = "error_learned_over_before_worst_muscle"
        found[name] = metric([value for value in worst if value is not None], "")
    seconds = [max(muscle["named_s"] or np.inf for muscle in own) for own in muscles]
    found["named_share"] = metric(
        [float(np.mean([muscle["named_s"] is not None for muscle in own])) for own in muscles],
        "", must=1.0, good="high", by="worst",
    )  # fmt: skip
    if np.isfinite(seconds).all():
        found["named_after_s"] = metric(seconds, "s")
    false = [
        float(len(robot["false"]) + sum(len(muscle["others"]) for muscle in own))
        for robot, own in zip(robots, muscles, strict=True)
    ]
    found["intact_muscles_named"] = metric(false, "", must=0.0, by="worst")
    for key, must in (("demanded_N", LIMIT), ("largest_N", None)):
        largest = [max(_largest(muscle, key) for muscle in own) for own in muscles]
        name = {"demanded_N": "largest_demand_N", "largest_N": "largest_tension_N"}[key]
        found[name] = metric(largest, "N", must=must, by="worst")
    kept = [1.0 - float(np.mean([muscle["lost"] for muscle in own])) for own in muscles]
    found["postures_that_can_be_held"] = metric(kept, "", good="high")
    for name, what in (("named_joint_right", named_joints), ("held_as_on_the_robot", agreement)):
        shares = [float(np.mean(what(robot))) for robot in robots if what(robot)]
        if shares:
            found[name] = metric(shares, "", good="high")
    replaced = [float(np.median(nearest(robot))) for robot in robots if nearest(robot)]
    if replaced:
        found["error_at_nearest_posture_deg"] = metric(replaced, "deg")
    return found


def _largest(muscle: Mapping[str, Any], key: str) -> float:
    """Largest tension or demand [N] from the moment at which a muscle snapped."""
    return max(one[key] for one in [muscle, *muscle["after"], *muscle["learned"]])


def tables(results: Results) -> list[Table]:
    """A row for each muscle of each robot."""
    rows = []
    for seed, result in results.items():
        robot = result[ACTUAL]
        for muscle in robot["muscles"]:
            before = [one["wanted_deg"] for one in robot["before"]]
            cells = []
            for key in ("unnoticed", "after", "learned"):
                one, two = held(robot["before"], muscle[key])
                cells.append(f"{np.median(one):.1f}, {np.median(two):.1f}" if one else "-")
            own = {"muscles": [muscle]}
            far, right = nearest(own), named_joints(own)
            rows.append(
                (
                    seed,
                    muscle["muscle"],
                    "never" if muscle["named_s"] is None else f"{muscle['named_s']:.2f}",
                    f"{100 * (1 - muscle['lost']):.0f}, {100 * (1 - muscle['lost_actual']):.0f}",
                    f"{np.median(before):.1f}",
                    *cells,
                    muscle["observations"],
                    f"{np.median(far):.1f}" if far else "-",
                    f"{sum(right)} of {len(right)}",
                    f"{_largest(muscle, 'largest_N'):.0f}",
                )
            )
    header = ("robot", "muscle", "named after [s]", "can be held, by agent and robot [%]",
              "before [deg]", "unnoticed", "right after", "after ten more postures",
              "observations learned from", "at the nearest posture [deg]", "joint named rightly",
              "largest tension [N]")  # fmt: skip
    note = (
        "Medians over postures. Errors with a snapped muscle are pairs: before and after at the "
        "postures that the balance says can still be held."
    )
    return [Table("Snapped muscles", header, rows, note)]


def per_seed(results: Results) -> dict[int, Any]:
    """Ratios of the errors, and the muscles, of each robot."""
    return {
        seed: {
            "muscles": [muscle["muscle"] for muscle in result[ACTUAL]["muscles"]],
            **{key: ratio(result[ACTUAL], key) for key in ("unnoticed", "after", "learned")},
        }
        for seed, result in results.items()
    }
