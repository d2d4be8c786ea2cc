"""Figure of cloned policies beside the learning agent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib

matplotlib.use("Agg")

from matplotlib import pyplot

from experiments.harness.report import Picture, png

COLOURS = ("#3f8f3f", "#3a6fb5", "#c8452f")


def success_figure(shares: Mapping[str, Sequence[float]], names: Sequence[str]) -> Picture:
    """Share of episodes with a lifted can on each robot.

    Args:
        shares: of each policy, one number a robot.
        names: of the robots.
    """
    figure, axis = pyplot.subplots(figsize=(9, 3.6), layout="constrained")
    width = 0.8 / len(shares)
    for number, (policy, values) in enumerate(shares.items()):
        offset = (number - (len(shares) - 1) / 2) * width
        locations = [i + offset for i in range(len(values))]
        axis.bar(locations, values, 0.9 * width, label=policy, color=COLOURS[number])
    axis.set_xticks(range(len(names)), names)
    axis.set(ylim=(0.0, 1.05), ylabel="episodes with a lifted can [1]")
    axis.legend(ncol=len(shares), fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    picture = Picture("Lifted cans on robots that no policy was cloned from", png(figure))
    pyplot.close(figure)
    return picture
