"""Figures of few observations: errors by number of looks, and what each source tells."""

from __future__ import annotations

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib.figure import Figure

from experiments.few_observations import methods
from experiments.few_observations.methods import Sizes
from experiments.few_observations.sources import SOURCES
from experiments.harness.experiment import Results
from experiments.harness.report import GROUP_COLOURS, Picture, png
from experiments.harness.statistics import interval
from kengoro_env.names import GROUP_JOINTS, JOINTS

STYLES = {
    methods.OURS: ("#c8452f", "-", "o"),
    methods.LENGTHS: ("#3a6fb5", "-", "s"),
    methods.CONSTANTS: ("#8c6bb1", "-", "^"),
    methods.PAPER: ("#777777", "--", "v"),
    methods.GAUSSIAN: ("#3f8f3f", ":", "P"),
    methods.POLYNOMIAL: ("#d39a2a", ":", "D"),
}
"""Colour, line and marker of each method."""
PANELS = {"target_true_deg": "joints, target - true [deg]", "target_true_mm": "hand [mm]"}


def pictures(results: Results, sizes: Sizes) -> list[Picture]:
    """All figures of the report."""
    return [
        Picture(
            "Errors by number of looks",
            png(_curves(results, sizes)),
            "Medians over robots; bars: 95 % intervals of ours. Both axes are logarithmic.",
        ),
        Picture(
            "What each source tells, by joint",
            png(_sources(results)),
            "Bars: true error, RMS over ten rests, median over robots. Black marks: what the fit "
            "predicts.",
        ),
    ]


def _curves(results: Results, sizes: Sizes) -> Figure:
    figure = Figure(figsize=(11, 5.2), layout="constrained")
    for axes, (key, label) in zip(figure.subplots(1, 2), PANELS.items(), strict=True):
        for name, (colour, line, marker) in STYLES.items():
            found = [interval(methods.numbers(results, name, count, key)) for count in sizes.counts]
            values = [one.median for one in found]
            title = methods.METHODS[name]
            axes.plot(sizes.counts, values, line, marker=marker, color=colour, label=title)
            if name == methods.OURS:
                bars = np.abs([[one.median - one.low, one.high - one.median] for one in found]).T
                axes.errorbar(sizes.counts, values, bars, color=colour, capsize=3, lw=1)
        before = np.median(methods.numbers(results, methods.OURS, 0, key))
        axes.axhline(before, color="black", lw=1, ls="--", label="before learning")
        axes.set(xscale="log", yscale="log", xlabel="number of looks", ylabel=label)
        axes.set_xticks(sizes.counts, [str(count) for count in sizes.counts])
        axes.minorticks_off()
        low, high = axes.get_ylim()
        ticks = [t for t in (1, 2, 5, 10, 20, 50, 100, 200, 500) if low <= t <= high]
        axes.set_yticks(ticks, [str(tick) for tick in ticks])
        axes.grid(alpha=0.3)
    figure.legend(
        *figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=9
    )
    return figure


def _sources(results: Results) -> Figure:
    figure = Figure(figsize=(11, 6.6), layout="constrained")
    group = {joint: name for name, joints in GROUP_JOINTS.items() for joint in joints}
    colours = [GROUP_COLOURS[group[joint]] for joint in JOINTS]
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    for axes, (name, title) in zip(panels.flat, SOURCES.items(), strict=True):
        parts = [result[methods.BY_SOURCE][name] for result in results.values()]
        error = np.median([part["error_joints_deg"] for part in parts], axis=0)
        predicted = np.median([part["predicted_joints_deg"] for part in parts], axis=0)
        axes.bar(JOINTS, error, color=colours)
        axes.plot(JOINTS, predicted, "k_", ms=12, mew=2)
        axes.set_title(title, loc="left")
        axes.tick_params(axis="x", rotation=90)
        axes.grid(axis="y", alpha=0.3)
    for axes in panels[:, 0]:
        axes.set_ylabel("error of a joint angle [deg]")
    return figure
