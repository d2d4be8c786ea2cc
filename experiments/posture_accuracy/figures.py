"""Figures of posture accuracy: bars as in the paper, each robot, each joint."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes

from experiments.harness.experiment import Results
from experiments.harness.report import Picture, png
from experiments.posture_accuracy.tables import MEASURES, WHEN, by_posture
from experiments.robots.conditions import ACTUAL, NOMINAL
from jmm_agent.types import Floats
from kengoro.visits import ERRORS, gaps
from kengoro_env.names import JOINTS

COLOURS = {"before": "#8c8c8c", "after": "#c8452f"}
PAIRS = ("estimate_seen", "target_true")
LABELS = {"deg": "RMSE_joint [deg]", "mm": "Distance_hand [mm]"}
WIDTH = 0.38


def pictures(results: Results) -> list[Picture]:
    """Bars over postures as in the paper, then each robot, then each joint."""
    figure, grid = pyplot.subplots(2, 2, figsize=(11, 6.6), sharex=True, sharey="row")
    for row, unit in zip(grid, MEASURES, strict=True):
        for ax, pair in zip(row, PAIRS, strict=True):
            draw_postures(ax, results, pair, unit)
        row[0].set_ylabel(LABELS[unit])
        row[0].set_ylim(bottom=0)  # of both, which share it
    for ax, pair in zip(grid[0], PAIRS, strict=True):
        ax.set_title(ERRORS[pair])
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="upper center", ncol=2, fontsize=9)
    figure.tight_layout(rect=(0, 0, 1, 0.95))
    found = [
        Picture(
            "Before and after online learning with both updaters",
            png(figure),
            "Bars: mean over the actual robots, each with five postures of its own, and over all "
            "postures. Error bars: standard deviation over the start postures, mean over robots. "
            "Dots: robots.",
        )
    ]
    figure, axes = pyplot.subplots(1, 2, figsize=(max(9.0, 2 + len(results)), 3.8))
    for ax, unit in zip(axes, MEASURES, strict=True):
        draw_robots(ax, results, unit)
        ax.set_ylabel(LABELS[unit])
    figure.legend(*axes[0].get_legend_handles_labels(), loc="upper center", ncol=3, fontsize=8)
    figure.tight_layout(rect=(0, 0, 1, 0.87))
    found.append(
        Picture("Each robot, mean over its trials", png(figure), "Grey before, red after learning.")
    )
    figure, ax = pyplot.subplots(figsize=(11, 3.6))
    draw_joints(ax, results)
    figure.tight_layout()
    found.append(
        Picture(
            "Error by joint after learning",
            png(figure),
            "Root mean square over the trials of a robot, median over the actual robots. A joint "
            "whose estimate - true is larger than estimate - seen is poorly observable.",
        )
    )
    pyplot.close("all")
    return found


def draw_postures(axes: Axes, results: Results, pair: str, unit: str) -> None:
    """Draw bars before and after learning, by posture."""
    count = 0
    for side, when in zip((-0.5, 0.5), WHEN, strict=True):
        found = [
            by_posture(result[ACTUAL][when], result[ACTUAL]["starts"], pair, unit)
            for result in results.values()
        ]
        means, spreads = (_table(found, measure) for measure in (np.mean, np.std))
        count = means.shape[1] - 1
        locations = np.arange(count + 1) + side * WIDTH
        height, error = np.nanmean(means, axis=0), np.nanmean(spreads, axis=0)
        axes.bar(locations, height, WIDTH, color=COLOURS[when], label=when, yerr=error, capsize=4)
        across = np.linspace(-0.3, 0.3, len(means)) * WIDTH if len(means) > 1 else np.zeros(1)
        locations_of = locations + across[:, None]
        axes.plot(locations_of.ravel(), means.ravel(), ".", color="black", ms=3, alpha=0.6)
    axes.axvline(count - 0.5, color="0.6", lw=0.8)
    names = [f"posture {k + 1}" for k in range(count)]
    axes.set_xticks(range(count + 1), [*names, "all"], fontsize=9)


def _table(found: list[list[Floats]], measure: Callable[[Floats], Any]) -> Floats:
    """A measure of each robot's trials by posture, with the mean over postures as last column.

    NaN where the hand was not seen.
    """
    rows = [[measure(e) if e.size else np.nan for e in postures] for postures in found]
    table = np.array(rows, dtype=float)
    return np.column_stack([table, np.nanmean(table, axis=1)])


def draw_robots(axes: Axes, results: Results, unit: str) -> None:
    """Draw each robot's mean before and after learning, seen and true."""
    observations = (
        (ACTUAL, "estimate_seen", "o", -0.2),
        (ACTUAL, "target_true", "D", 0.0),
        (NOMINAL, "target_true", "_", 0.2),
    )
    for condition, pair, marker, aside in observations:
        for when in WHEN:
            found = [MEASURES[unit](result[condition][when], pair) for result in results.values()]
            values = [float(errors.mean()) if errors.size else np.nan for errors in found]
            locations = np.arange(len(values)) + aside
            label = f"{ERRORS[pair]}, {condition}, {when}"
            axes.plot(locations, values, marker, color=COLOURS[when], ms=6, mew=1.5, label=label)
    axes.set_xticks(range(len(results)), [str(seed) for seed in results])
    axes.set_xlabel("robot")
    axes.set_xlim(-0.6, len(results) - 0.4)
    axes.set_ylim(bottom=0)
    axes.grid(axis="y", color="0.9")


def draw_joints(axes: Axes, results: Results) -> None:
    """Draw the error of each joint after learning."""
    colours = {"estimate_seen": "#D55E00", "estimate_true": "#0072B2", "target_true": "#009E73"}
    for number, (pair, colour) in enumerate(colours.items()):
        found = [gaps(result[ACTUAL]["after"], pair) for result in results.values()]
        rms = [np.degrees(np.sqrt(np.mean(gap**2, axis=0))) for gap in found if len(gap)]
        locations = np.arange(len(JOINTS)) + 0.27 * (number - 1)
        axes.bar(locations, np.median(rms, axis=0), 0.25, color=colour, label=ERRORS[pair])
    axes.set_xticks(range(len(JOINTS)), JOINTS, rotation=35, ha="right", fontsize=9)
    axes.set_ylabel("error [deg]")
    axes.legend(fontsize=9)
