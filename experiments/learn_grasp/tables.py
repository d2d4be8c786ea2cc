"""Metrics and tables of policies that learn to grasp."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

from experiments.harness.report import Table
from experiments.harness.statistics import metric

MUST = 0.6
"""Share of lifted cans on the drawing, which each seed must reach."""
UNITS = {"demonstrations": "demonstrations", "reward": "rows of 0.2 s"}
EXTRA: dict[str, tuple[str, Literal["low", "high"]]] = {
    "reward": ("", "high"),
    "distance": ("m", "low"),
    "grasped": ("of episodes", "high"),
}
"""Further numbers of policies that are trained from the reward."""


def metrics_of(learned: Mapping[int, Mapping[str, Any]]) -> dict[str, Any]:
    """Metrics of the last policies."""
    results = list(learned.values())

    def others(name: str) -> list[float]:
        """Mean over seeds and episodes on each other robot."""
        return [float(np.mean([one[name][robot] for one in results])) for robot in results[0][name]]

    def last(name: str) -> dict[int, float]:
        """Mean over the episodes on the drawing of each seed."""
        return {seed: float(np.mean(one[name][-1])) for seed, one in learned.items()}

    metrics = {
        "lifted on the drawing": metric(
            last("lifted"), "of episodes", MUST, good="high", by="worst"
        ),
        "lifted on other robots": metric(others("robots"), "of episodes", good="high"),
    }
    for name, (unit, good) in EXTRA.items():
        if name in results[0]:
            metrics[name] = metric(last(name), unit, good=good)
    if "robots_distance" in results[0]:
        metrics["distance on other robots"] = metric(others("robots_distance"), "m")
    if "cans" in results[0]:
        cans = results[0]["cans"]
        share = _not_seen(cans) / _episodes(cans)
        metrics["can not seen"] = metric([share], "of judged episodes")
    return metrics


def result_table(by: str, learned: Mapping[int, Mapping[str, Any]]) -> Table:
    """Share of lifted cans after each amount of learning, and on other robots at the end."""
    results = list(learned.values())
    rows = [
        [f"{at}", "drawing", *_shares([np.mean(one["lifted"][i]) for one in results])]
        for i, at in enumerate(results[0]["at"])
    ]
    for robot in results[0]["robots"]:
        shares = [np.mean(one["robots"][robot]) for one in results]
        rows.append([f"{results[0]['at'][-1]}", robot, *_shares(shares)])
    head = (UNITS[by], "robot", "lifted, median over seeds", "worst seed")
    note = (
        f"{len(results)} seeds of the training, each judged in {len(results[0]['lifted'][0])} "
        "episodes on the drawing. No policy has learned on the other robots."
    )
    return Table("Lifted cans at new positions", head, rows, note)


def _shares(shares: Sequence[Any]) -> list[str]:
    return [f"{np.median(shares):.0%}", f"{min(shares):.0%}"]


Cans = Mapping[str, Mapping[str, Sequence[Any]]]
"""``cans`` of a result, see `Learned`."""


def camera_table(cans: Cans) -> Table:
    """How well the camera measured the can in the judged episodes of each robot."""
    rows = []
    for robot, own in cans.items():
        errors = 1e3 * np.array(own["errors"])
        seen = f"{sum(own['seen'])} of {len(own['seen'])}"
        rows.append([robot, seen, f"{np.median(errors):.1f}", f"{np.max(errors):.1f}"])
    head = ("robot", "can seen", "error of its position, median [mm]", "largest [mm]")
    note = (
        f"The can was not seen in {_not_seen(cans)} of {_episodes(cans)} judged episodes, which "
        "are the same for all policies. There policies are given the middle of the area in which "
        "cans stand."
    )
    return Table("Position of the can by the camera", head, rows, note)


def _not_seen(cans: Cans) -> int:
    return sum(not seen for own in cans.values() for seen in own["seen"])


def _episodes(cans: Cans) -> int:
    return sum(len(own["seen"]) for own in cans.values())
