"""Figure of strange robots: errors of each family by number of looks."""

from __future__ import annotations

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib.figure import Figure

from experiments.harness.experiment import Results
from experiments.harness.report import Picture, plain_ticks, png
from experiments.strange_robots.families import PRESET
from experiments.strange_robots.tables import (
    MUST,
    MUST_RATIO,
    UNITS,
    conditions,
    last,
    numbers,
)
from experiments.strange_robots.trial import Sizes

COLOURS = ("#bbbbbb", "#f0b27a", "#e07b54", "#c8452f", "#3a6fb5")
"""Of the numbers of looks, in order."""
LABELS = {"deg": "joints, target - true [deg]", "mm": "hand, target - true [mm]"}


def pictures(results: Results, sizes: Sizes) -> list[Picture]:
    """All figures of the report."""
    return [
        Picture(
            "Errors by family and number of looks",
            png(_bars(results, sizes)),
            "Bars: medians over robots; dots: robots. Black lines: the most that the last bar may "
            "be; of a family that is compared with the preset about that, because the metric is "
            "the median of the robots' ratios.",
        )
    ]


def _bars(results: Results, sizes: Sizes) -> Figure:
    figure = Figure(figsize=(13.0, 8.0), layout="constrained")
    counts = (0, *sizes.counts, sizes.long)
    width = 0.8 / len(counts)
    shown = conditions(results)
    for axes, (unit, key) in zip(figure.subplots(2, 1, sharex=True), UNITS.items(), strict=True):
        for rank, (count, colour) in enumerate(zip(counts, COLOURS, strict=False)):
            known = [
                number
                for number, condition in enumerate(shown)
                if count in (0, *sizes.counts_of(condition))
            ]
            each = [numbers(results, shown[number], count, key) for number in known]
            at = np.array(known) + (rank - len(counts) / 2 + 0.5) * width
            axes.bar(at, [np.median(one) for one in each], width, color=colour, label=str(count))
            for x, robots in zip(at, each, strict=True):
                axes.plot(np.full(len(robots), x), robots, "k.", ms=3)
        for number, condition in enumerate(shown):
            most = _most(results, condition, unit, sizes)
            if most is not None:
                axes.plot([number - 0.45, number + 0.45], [most, most], "k-", lw=1.5)
        axes.set(yscale="log", ylabel=LABELS[unit])
        plain_ticks(axes.yaxis)
        axes.grid(axis="y", alpha=0.3)
    names = [name.replace("-", "\n") for name in shown]
    axes.set_xticks(range(len(shown)), names, fontsize=9)
    handles = figure.axes[0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside upper center", ncols=len(counts), title="number of looks")
    return figure


def _most(results: Results, condition: str, unit: str, sizes: Sizes) -> float | None:
    """The limit, or the limit of the ratio times the preset's median; None without a limit."""
    if condition in MUST:
        return MUST[condition][unit == "mm"]
    if condition not in MUST_RATIO:
        return None
    twin = numbers(results, PRESET, last(condition, sizes), UNITS[unit])
    return MUST_RATIO[condition] * float(np.median(twin))
