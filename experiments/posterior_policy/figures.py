"""Figure of the rewards on each robot."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib

matplotlib.use("Agg")

from matplotlib import pyplot

from experiments.harness.report import Picture, png
from experiments.posterior_policy.models import CONDITIONS, NAMES
from experiments.posterior_policy.tables import Judged

COLOURS = ("#666666", "#d39a2a", "#3f8f3f", "#0072B2", "#D55E00")


def reward_figure(judged: Judged, robots: Sequence[int]) -> Picture:
    """Reward of a step on each robot: a point for each training seed."""
    figure, axis = pyplot.subplots(figsize=(7, 4.2), layout="constrained")
    for i, (condition, colour) in enumerate(zip(CONDITIONS, COLOURS, strict=True)):
        points = [
            (at + 0.14 * (i - 2), one["reward"])
            for at, robot in enumerate(robots)
            for one in judged[condition][robot]
        ]
        axis.plot(*zip(*points, strict=True), "o", ms=4, color=colour, label=NAMES[condition])
    axis.set(xlabel="robot", ylabel="mean reward of a step [1]")
    axis.set_xticks(range(len(robots)), [str(robot) for robot in robots])
    axis.legend(fontsize=8, ncols=3)
    image = png(figure)
    pyplot.close(figure)
    return Picture("Reward on each robot", image, "A point is a training seed.")
