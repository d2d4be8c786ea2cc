"""Figures of few observations: errors by number of looks, and what each source tells."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.few_observations import methods
from experiments.few_observations.methods import Sizes
from experiments.few_observations.sources import SOURCES
from experiments.harness.experiment import Results
from experiments.harness.report import GROUP_COLOURS, Picture, plain_ticks, png
from experiments.harness.statistics import interval
from jmm_agent.types import Floats
from kengoro_env.names import GROUP_JOINTS, JOINTS

STYLES = {
    methods.LENGTHS: ("#3a6fb5", "s"),
    methods.CONSTANTS: ("#8c6bb1", "^"),
    methods.PAPER: ("#777777", "v"),
    methods.OFFSETS: ("#8c6bb1", "^"),
    methods.GAUSSIAN: ("#3f8f3f", "P"),
    methods.POLYNOMIAL: ("#d39a2a", "D"),
    methods.ROUTE_CHANGE: ("#3a6fb5", "s"),
    methods.AUTOENCODER: ("#777777", "v"),
    methods.PHYSICS: ("#14889c", "X"),
}
"""Colour and marker of each method but ours, in whose panels no two are the same."""
OURS_COLOUR = "#c8452f"
PANELS = {"target_true_deg": "joints, target - true [deg]", "target_true_mm": "hand [mm]"}
ROWS = {
    "Each drives the robot to the postures that it learns from": methods.DRIVING,
    "All get joint angles, tensions and lengths of our looks": methods.GIVEN,
}
"""Rows of the figure of errors, and their methods; ours is in all panels."""
APART = 0.035
"""Distance of the bars of two methods, as a share of a number of looks [1]."""


def pictures(results: Results, sizes: Sizes) -> list[Picture]:
    """All figures of the report."""
    return [
        Picture(
            "Errors by number of looks",
            png(_curves(results, sizes)),
            "Medians over robots, with 95 % intervals: a band for ours, bars for others. Both axes "
            "are logarithmic.",
        ),
        Picture(
            "What each source tells, by joint",
            png(_sources(results)),
            "Bars: true error, RMS over ten rests, median over robots. Black marks: what the fit "
            "predicts.",
        ),
    ]


def _curves(results: Results, sizes: Sizes) -> Figure:
    figure = Figure(figsize=(11, 10.4), layout="constrained")
    panels = figure.subplots(len(ROWS), len(PANELS), sharex=True, sharey="col")
    for axes_row, (title, names) in zip(panels, ROWS.items(), strict=True):
        for axes, (key, label) in zip(axes_row, PANELS.items(), strict=True):
            _draw_errors(axes, results, sizes, names, key)
            axes.set(xlabel="number of looks", ylabel=label)
        axes_row[0].set_title(title, loc="left", fontsize=11)
        axes_row[1].legend(fontsize=8, loc="lower left")
    for axes in panels[0]:
        plain_ticks(axes.yaxis)
    return figure


def _draw_errors(
    axes: Axes, results: Results, sizes: Sizes, names: Mapping[str, str], key: str
) -> None:
    """Medians and intervals of our errors and those of some methods."""
    counts = np.array(sizes.counts)
    before = np.median(methods.numbers(results, methods.OURS, 0, key))
    axes.axhline(before, color="black", lw=1, ls="--", label="before learning")
    median, low, high = _intervals(results, methods.OURS, sizes, key)
    axes.fill_between(counts, low, high, color=OURS_COLOUR, alpha=0.2, lw=0)
    title = "ours: looks, lengths, tensions, zero posture"
    axes.plot(counts, median, "-o", color=OURS_COLOUR, lw=2.5, label=title, zorder=3)
    others = [name for name in names if name != methods.OURS]
    for rank, name in enumerate(others):
        colour, marker = STYLES[name]
        at = counts * (1.0 + APART * (rank - (len(others) - 1) / 2.0))
        median, low, high = _intervals(results, name, sizes, key)
        bars = np.array([median - low, high - median])
        title = names[name].removesuffix(methods.FROM_OURS)
        style: dict[str, Any] = {"marker": marker, "color": colour, "label": title}
        axes.errorbar(at, median, bars, ms=5, lw=1.2, elinewidth=0.8, capsize=2, **style)
    axes.set(xscale="log", yscale="log")
    axes.set_xticks(sizes.counts, [str(count) for count in sizes.counts])
    axes.minorticks_off()
    axes.grid(alpha=0.3)


def _intervals(results: Results, name: str, sizes: Sizes, key: str) -> Floats:
    """Medians, lower and upper ends of the intervals (3, counts)."""
    found = [interval(methods.numbers(results, name, count, key)) for count in sizes.counts]
    return np.array(found).T


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
