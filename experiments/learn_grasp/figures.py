"""Figure of policies that learn to grasp: lifted cans over the amount of learning."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot

from experiments.harness.report import Picture, png

LEARNED, GREY = "#0072B2", "#666666"


def learning_curve(unit: str, learned: Mapping[int, Mapping[str, Any]], must: float) -> Picture:
    """Share of lifted cans on the drawing, of each seed and their median.

    Args:
        unit: of the amount of learning.
        learned: results by seed, see `Learned`.
        must: share that is to be reached.
    """
    results = list(learned.values())
    at = results[0]["at"]
    shares = np.array([[np.mean(episodes) for episodes in one["lifted"]] for one in results])
    figure, axis = pyplot.subplots(figsize=(7, 4.2), layout="constrained")
    for number, own in enumerate(shares):
        axis.plot(at, own, ".-", color=LEARNED, alpha=0.35, lw=1, label="" if number else "seed")
    axis.plot(at, np.median(shares, axis=0), "o-", ms=5, color=LEARNED, label="median")
    axis.axhline(must, color=GREY, ls="--", lw=1.2, label="to be reached")
    axis.set(
        xlabel=unit, ylabel="episodes with a lifted can [1]", ylim=(-0.03, 1.05), xlim=(0, None)
    )
    axis.legend(loc="center right", fontsize=8)
    picture = Picture(
        "Lifted cans on the drawing, at positions that were not learned from",
        png(figure),
        f"{len(results)} seeds of the training.",
    )
    pyplot.close(figure)
    return picture
