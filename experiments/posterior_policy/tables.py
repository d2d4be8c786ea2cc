"""Numbers of the policies on robots: shares of what training on the robot itself brings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.harness.report import Table
from experiments.harness.statistics import interval, metric
from experiments.posterior_policy.models import (
    CONDITIONS,
    DIAGNOSED,
    DRAWING,
    EXTENDED,
    NAMES,
    POSTERIOR,
    TRUE,
)

MUST = 0.6
"""Least share of what separates the drawing from the robot itself."""
LEAST = 0.01
"""Smallest such difference of reward at which a share is computed."""
Judged = Mapping[str, Mapping[int, Sequence[Mapping[str, float]]]]
"""Numbers of each policy, by condition, robot and training seed."""


def means(judged: Judged, key: str) -> dict[str, list[float]]:
    """Mean over training seeds of a number on each robot, by condition."""
    return {
        condition: [float(np.mean([one[key] for one in found])) for found in robots.values()]
        for condition, robots in judged.items()
    }


def shares(rewards: Mapping[str, Sequence[float]], condition: str) -> list[float]:
    """Share of each robot; those where less than `LEAST` can be had are left out."""
    columns = (rewards[DRAWING], rewards[condition], rewards[TRUE])
    return [
        (own - drawing) / (true - drawing)
        for drawing, own, true in zip(*columns, strict=True)
        if true - drawing >= LEAST
    ]


def share_metric(found: Sequence[float]) -> dict[str, Any]:
    """Metric of shares; without any it is not reached."""
    if found:
        return metric(found, "of (e) - (a)", MUST, good="high")
    missing = dict.fromkeys(("median", "worst", "low", "high"))
    return {**metric([0.0], "of (e) - (a)", MUST, good="high"), **missing, "reached": False}


def metrics(judged: Judged) -> dict[str, dict[str, Any]]:
    """Thresholds, and the differences that they are about."""
    rewards = means(judged, "reward")
    found = {
        f"{NAMES[condition]}: share": share_metric(shares(rewards, condition))
        for condition in DIAGNOSED
    }

    def above(one: str, other: str) -> list[float]:
        return [a - b for a, b in zip(rewards[one], rewards[other], strict=True)]

    found["reward of (d) above (c)"] = metric(above(POSTERIOR, EXTENDED), "", 0.0, good="high")
    found["reward of (e) above (a)"] = metric(above(TRUE, DRAWING), "", good="high")
    return found


def policy_table(judged: Judged) -> Table:
    """Reward, tension and success of each condition, medians over robots."""
    columns = {key: means(judged, key) for key in ("reward", "tension", "success")}
    rewards = columns["reward"]
    rows = []
    for condition in CONDITIONS:
        cells = [str(interval(column[condition])) for column in columns.values()]
        own = shares(rewards, condition)
        rows.append([NAMES[condition], *cells, str(interval(own)) if own else "-"])
    robots = len(rewards[TRUE])
    note = (
        f"Medians over {robots} robots of the mean over training seeds, with bootstrap 95 % "
        "intervals over robots. Success is an RMS error over all joints below 5 deg. Share: what a "
        f"policy has of the reward of (e) above (a), on the {len(shares(rewards, TRUE))} robots "
        f"where that is {LEAST} or more."
    )
    head = ("trained on", "reward of a step", "mean tension [N]", "steps with success", "share")
    return Table("Policies on the robots", head, rows, note)
