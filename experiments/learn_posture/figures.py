"""Figure of policies that learn postures: reward over steps of learning."""

from __future__ import annotations

from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot

from experiments.harness.report import Picture, png

LEARNED, RANDOM, GREY = "#0072B2", "#D55E00", "#666666"
LINES = {"still": ("holds still", ":"), "nominal": ("nominal lengths", "--")}


def learning_curve(
    algorithm: str, learned: dict[int, dict[str, Any]], others: dict[str, Any]
) -> Picture:
    """Median and range over policies, and the policies that do not learn."""
    steps = next(iter(learned.values()))["steps"]
    rewards = np.array([np.mean(one["short"], axis=1) for one in learned.values()])
    figure, axis = pyplot.subplots(figsize=(7, 4.2), layout="constrained")
    axis.fill_between(steps, rewards.min(0), rewards.max(0), color=LEARNED, alpha=0.2, lw=0)
    axis.plot(steps, np.median(rewards, axis=0), "o-", ms=4, color=LEARNED, label=algorithm)
    for name, (label, style) in LINES.items():
        mean = float(np.mean(others[name]["short"]["reward"]))
        axis.axhline(mean, color=GREY, ls=style, lw=1.2, label=label)
    low, middle, high = np.quantile(others["random"]["short"]["reward"], (0.25, 0.5, 0.75))
    axis.axhspan(low, high, color=RANDOM, alpha=0.2, lw=0)
    axis.axhline(middle, color=RANDOM, lw=1.2, label="random actions")
    axis.set(
        xlabel="steps of 20 ms [1]",
        ylabel="mean reward of a step [1]",
        ylim=(0.0, 1.0),
        xlim=(0, steps[-1]),
    )
    axis.legend(loc="upper left", ncols=2, fontsize=8)
    image = png(figure)
    pyplot.close(figure)
    return Picture(
        f"{algorithm}: reward in held-out episodes of one second",
        image,
        f"Line: median over {len(learned)} policies; band: range. Random actions: "
        "median and quartiles over episodes. Dashed and dotted: means over episodes.",
    )
