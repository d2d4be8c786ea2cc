"""Figure of gap to skill: errors with the maps of nominal and diagnosed model."""

from __future__ import annotations

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes

from experiments.gap_to_skill.tables import EXTENDED, NOMINAL
from experiments.harness.experiment import Results
from experiments.harness.report import Picture, png
from experiments.posture_accuracy.tables import MEASURES, WHEN

COLOURS = {NOMINAL: "#8c8c8c", EXTENDED: "#c8452f"}
LABELS = {"deg": "RMSE_joint, target - true [deg]", "mm": "Distance_hand, target - true [mm]"}


def pictures(results: Results) -> list[Picture]:
    """All figures of the report."""
    figure, axes = pyplot.subplots(1, 2, figsize=(9.5, 4.2))
    for ax, unit in zip(axes, MEASURES, strict=True):
        draw(ax, results, unit)
        ax.set_ylabel(LABELS[unit])
    figure.legend(*axes[0].get_legend_handles_labels(), loc="upper center", ncol=2, fontsize=9)
    figure.tight_layout(rect=(0, 0, 1, 0.93))
    found = Picture(
        "Errors with the maps of nominal and diagnosed model",
        png(figure),
        "Lines: actual robots, mean over trials. Bars: median over robots.",
    )
    pyplot.close("all")
    return [found]


def draw(axes: Axes, results: Results, unit: str) -> None:
    """Draw a line for each robot and condition, before and after online learning."""
    for condition, colour in COLOURS.items():
        found = np.array([
            [MEASURES[unit](result[condition][when], "target_true").mean() for when in WHEN]
            for result in results.values()
        ])  # fmt: skip
        axes.plot([0, 1], found.T, "o-", color=colour, ms=4, lw=1, alpha=0.7)
        axes.plot([], [], "o-", color=colour, label=f"map {condition.replace('-', ' ')}")
        for location, median in enumerate(np.median(found, axis=0)):
            axes.hlines(median, location - 0.12, location + 0.12, color=colour, lw=4)
    axes.set_xticks([0, 1], ["before online learning", "after"])
    axes.set_xlim(-0.35, 1.35)
    axes.set_ylim(bottom=0)
    axes.grid(axis="y", color="0.9")
