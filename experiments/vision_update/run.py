"""Vision Updater (paper, sec. IV-C): the estimate approaches the observation.

The Vision Updater works alone while the robot moves its hand in view of the camera. At each
posture, which is always new, the estimate is compared with the observation before learning from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.harness.report import Table
from experiments.harness.statistics import median_cell, metric
from experiments.robots.conditions import ACTUAL, NOMINAL, make_session
from jmm_agent.agent import AgentOptions
from kengoro.agents import make_agent
from kengoro.robots import shuffled_postures
from kengoro.visits import (
    ERRORS,
    error_rows,
    errors,
    group_joints,
    no_visits,
    rmse_deg,
    visit,
)

EARLY, LATE = 3, 9
"""Number of visits at the beginning and at the end for the medians."""


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        postures: number of postures.
        move: duration of a movement [s].
        patience: longest wait for rest [s].
    """

    postures: int = 36
    move: float = 2.0
    patience: float = 2.5


QUICK = Sizes(postures=5, move=1.0, patience=1.5)


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """Run one robot, which moves its hand in view of the camera and learns."""
    from experiments.vision_update.figures import estimated_and_seen

    agent = make_agent(seed, options=AgentOptions(learn_antagonism=False), cache=cache)
    start, shown, *postures = shuffled_postures(seed)[: 2 + sizes.postures]
    session = make_session(condition, seed, agent, start)
    agent.learning = False
    visit(session, shown, None, sizes.move, sizes.patience)
    before = estimated_and_seen(session)
    agent.learning = True
    visits = no_visits()
    for posture in postures:
        visit(session, posture, visits, sizes.move, sizes.patience)
    agent.learning = False
    visit(session, shown, None, sizes.move, sizes.patience)
    after = estimated_and_seen(session)
    session.env.close()
    return {
        "visits": visits,
        "before": before,
        "after": after,
        "fired": agent.vision.fired,
        "dropped": agent.vision.dropped,
    }


def part(result: dict[str, Any], late: bool) -> dict[str, list[Any]]:
    """Early or late visits of a robot."""
    chosen = slice(-LATE, None) if late else slice(EARLY)
    return {key: values[chosen] for key, values in result["visits"].items()}


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Error of the shoulder at the beginning and at the end, by both definitions."""
    from experiments.vision_update.figures import pictures

    shoulder = group_joints()["shoulder"]

    def medians(pair: str, late: bool, condition: str = ACTUAL) -> dict[int, float]:
        return {
            seed: float(np.median(rmse_deg(part(result[condition], late), pair, shoulder)))
            for seed, result in results.items()
        }

    metrics = {
        "shoulder_seen_first": metric(medians("estimate_seen", late=False), "deg", paper=16.0),
        "shoulder_seen_last": metric(medians("estimate_seen", late=True), "deg", 3.0, 3.0),
        "shoulder_true_first": metric(medians("estimate_true", late=False), "deg"),
        "shoulder_true_last": metric(medians("estimate_true", late=True), "deg"),
        "shoulder_true_last_nominal": metric(medians("estimate_true", True, NOMINAL), "deg"),
    }
    per_seed = {
        seed: {
            condition: {
                "first": errors(part(result[condition], late=False)),
                "last": errors(part(result[condition], late=True)),
                "updates": result[condition]["fired"],
                "dropped": result[condition]["dropped"],
            }
            for condition in (ACTUAL, NOMINAL)
        }
        for seed, result in results.items()
    }
    columns = {
        f"{condition}, {when}": [entry[condition][when] for entry in per_seed.values()]
        for condition in (ACTUAL, NOMINAL)
        for when in ("first", "last")
    }
    tables = [
        group_table(results),
        Table(
            "All joints, both definitions of error: median over robots (worst robot)",
            ("", *columns),
            error_rows(columns),
            f"First: medians of the first {EARLY} postures; last: of the last {LATE}.",
        ),
    ]
    return Findings(metrics, per_seed, tables, pictures(results), {})


def group_table(results: Results) -> Table:
    """Table of each group's error at the beginning and at the end."""
    rows = []
    for group, joints in group_joints().items():
        for pair in ("estimate_seen", "estimate_true"):
            cells = []
            for condition in (ACTUAL, NOMINAL):
                for late in (False, True):
                    found = [
                        np.median(rmse_deg(part(r[condition], late), pair, joints))
                        for r in results.values()
                    ]
                    cells.append(median_cell(found))
            rows.append((f"{group}, {ERRORS[pair]} [deg]", *cells))
    return Table(
        "RMSE_joint by group: median over robots (worst robot)",
        ("", "actual, first", "actual, last", "nominal, first", "nominal, last"),
        rows,
        "Each posture is new; the estimate is compared before learning from it.",
    )


EXPERIMENT = Experiment(
    name="vision-update",
    title="Vision Updater",
    introduction=(
        "The Vision Updater works alone. The robot moves its hand in view of the camera; at each "
        "new posture the estimated joint angles are compared with those seen, before learning. The "
        "same is done on robots without departures."
    ),
    figure="Fig. 10",
    conditions=(ACTUAL, NOMINAL),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)


@dataclass(frozen=True)
class Args(common.Args):
    """Vision Updater: the estimate approaches the joint angles that are seen (Fig. 10)."""

    seeds: str = "0-9"
    out: Path = Path("out/vision-update")


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary."""
    return run_experiment(EXPERIMENT, args)
