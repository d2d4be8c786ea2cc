"""Vision Updater (paper, sec. IV-C): the estimate comes to where the eyes see the hand.

The Vision Updater works alone while the arm moves its hand before its eyes. At each posture, which
is always a new one, the estimate is compared with what is seen before it is learned from.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.harness.experiment import Findings, Results, Study
from experiments.harness.report import Table
from experiments.harness.statistics import metric
from jmm_agent.agent import AgentOptions
from kengoro.arm import ACTUAL, NOMINAL, make_session, new_agent, shuffled_postures
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
"""Visits at the beginning and at the end over which the median is taken."""


@dataclass(frozen=True)
class Sizes:
    """How much is done: number of postures, time for each movement and wait for rest [s]."""

    postures: int = 36
    move: float = 2.0
    patience: float = 2.5


QUICK = Sizes(postures=5, move=1.0, patience=1.5)


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """One robot moves its hand before its eyes and learns from what it sees."""
    from experiments.vision_update.figures import believed_and_seen

    agent = new_agent(cache, seed, options=AgentOptions(learn_antagonism=False))
    start, shown, *postures = shuffled_postures(seed)[: 2 + sizes.postures]
    session = make_session(condition, seed, agent, start)
    agent.learning = False
    visit(session, shown, None, sizes.move, sizes.patience)
    before = believed_and_seen(session)
    agent.learning = True
    visits = no_visits()
    for posture in postures:
        visit(session, posture, visits, sizes.move, sizes.patience)
    agent.learning = False
    visit(session, shown, None, sizes.move, sizes.patience)
    after = believed_and_seen(session)
    session.env.close()
    return {
        "visits": visits,
        "before": before,
        "after": after,
        "fired": agent.vision.fired,
        "dropped": agent.vision.dropped,
    }


def part(result: dict[str, Any], late: bool) -> dict[str, list[Any]]:
    """The early or the late visits of a robot."""
    chosen = slice(-LATE, None) if late else slice(EARLY)
    return {key: values[chosen] for key, values in result["visits"].items()}


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Shoulder's error at the beginning and at the end, by both definitions."""
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
    """Each group's error at the beginning and at the end."""
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
                    cells.append(f"{np.median(found):.1f} ({np.max(found):.1f})")
            rows.append((f"{group}, {ERRORS[pair]} [deg]", *cells))
    return Table(
        "RMSE_joint by group: median over robots (worst robot)",
        ("", "actual, first", "actual, last", "drawing, first", "drawing, last"),
        rows,
        "Each posture is a new one, compared before it is learned from.",
    )


STUDY = Study(
    name="vision-update",
    title="Vision Updater",
    introduction=(
        "The Vision Updater works alone. The robot moves its hand before its eyes; at each new "
        "posture the estimated joint angles are compared with those seen, then learned from. "
        "Beside the actual robots stand the same without departures."
    ),
    figure="Fig. 10",
    conditions=(ACTUAL, NOMINAL),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)
