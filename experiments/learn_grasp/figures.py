"""Figure of policies that learn to grasp: lifted cans over the amount of learning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot

from experiments.harness.report import Picture, png

LEARNED, GREY = "#0072B2", "#666666"


def learning_curves(unit: str, learned: Mapping[int, Mapping[str, Any]], must: float) -> Picture:
    """Share of lifted cans on the drawing, and the reward where that was learned from.

    Args:
        unit: of the amount of learning.
        learned: results by seed, see `Learned`.
        must: share of lifted cans that is to be reached.
    """
    results = list(learned.values())
    shown: dict[str, tuple[str, float | None]] = {
        "lifted": ("episodes with a lifted can [1]", must)
    }
    if "reward" in results[0]:
        shown["reward"] = ("mean reward of a step [1]", None)
    figure, axes = pyplot.subplots(
        1, len(shown), figsize=(1 + 6 * len(shown), 4.2), layout="constrained", squeeze=False
    )
    for axis, (name, (label, threshold)) in zip(axes[0], shown.items(), strict=True):
        _curves(axis, results, name)
        if threshold is not None:
            axis.axhline(threshold, color=GREY, ls="--", lw=1.2, label="to be reached")
        axis.set(xlabel=unit, ylabel=label, ylim=(-0.03, 1.05), xlim=(0, None))
        axis.legend(loc="center right", fontsize=8)
    picture = Picture(
        "Episodes on the drawing, at positions of the can that were not learned from",
        png(figure),
        f"{len(results)} seeds of the training.",
    )
    pyplot.close(figure)
    return picture


def _curves(axis: Any, results: Sequence[Mapping[str, Any]], name: str) -> None:
    """Mean over episodes of each seed, and the median over seeds."""
    at = results[0]["at"]
    means = np.array([[np.mean(episodes) for episodes in one[name]] for one in results])
    for number, own in enumerate(means):
        axis.plot(at, own, ".-", color=LEARNED, alpha=0.35, lw=1, label="" if number else "seed")
    axis.plot(at, np.median(means, axis=0), "o-", ms=5, color=LEARNED, label="median")
