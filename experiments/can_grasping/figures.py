"""Figures of the can-grasping experiment, in the paper's form."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from experiments.harness.experiment import Results
from experiments.harness.report import GROUP_COLOURS, Picture, png
from experiments.robots.conditions import ACTUAL, NOMINAL

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CAN_RADIUS_MM = 33.0


def figures(results: Results) -> list[Picture]:
    """Figures of the first robot, and hand distances of all robots."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    first = next(iter(results))
    curves = results[first][ACTUAL]["curves"]
    pictures = []

    figure, (errors, tensions) = pyplot.subplots(2, 1, figsize=(9, 6.5), sharex=True)
    _errors(errors, curves)
    _tensions(tensions, curves)
    figure.align_ylabels()
    figure.tight_layout()
    pictures.append(
        Picture(
            f"RMSE_joint and muscle tensions over time, robot {first}",
            png(figure),
            "Dots: estimate - seen at each observation, as in the paper. Line: estimate - true, "
            "which is known in simulation only. Shaded: approaches.",
        )
    )
    figure, axes = pyplot.subplots(figsize=(9, 3.4))
    _distances(axes, results)
    figure.tight_layout()
    pictures.append(
        Picture(
            "Distance of the grip point to its target before the fingers close",
            png(figure),
            "Filled: the can was lifted. Crosses: robots without departures. Dashed: radius of the "
            "can.",
        )
    )
    figure = _lengths(pyplot, curves)
    pictures.append(
        Picture(
            f"JMM of the ten shoulder muscles during shoulder flexion, robot {first}",
            png(figure),
            "Before and after; all other joints at zero.",
        )
    )
    pyplot.close("all")
    return pictures


def _shade(axes: Axes, curves: Mapping[str, Any]) -> None:
    for start in curves["approach_start"]:
        axes.axvspan(start, start + 9.0, color="0.9", zorder=0)


def _errors(axes: Axes, curves: Mapping[str, Any]) -> None:
    _shade(axes, curves)
    axes.plot(
        curves["time"], curves["true_error"], color="0.55", lw=1, label="all, estimate - true"
    )
    for name, errors in curves["observation_error"].items():
        colour, size = GROUP_COLOURS.get(name, "black"), 5 if name == "all" else 3
        label = f"{name}, estimate - seen"
        axes.plot(curves["observation_time"], errors, "o", ms=size, color=colour, label=label)
    axes.set_ylabel("RMSE_joint [deg]")
    axes.set_ylim(bottom=0.0)
    axes.legend(ncol=3, fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0))


def _tensions(axes: Axes, curves: Mapping[str, Any]) -> None:
    _shade(axes, curves)
    tensions = np.array(curves["tensions"])
    axes.plot(curves["time"], tensions, color="#3a6fb5", lw=0.5, alpha=0.35)
    axes.plot(curves["time"], tensions.max(axis=1), color="#c8452f", lw=1, label="largest")
    axes.set_ylabel("muscle tension [N]")
    axes.set_xlabel("time [s]")
    axes.set_ylim(bottom=0.0)
    axes.legend(fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 1.0))


def _distances(axes: Axes, results: Results) -> None:
    for location, result in enumerate(results.values()):
        approaches = result[ACTUAL]["summary"]["approaches"]
        nominal = [a["hand_distance_mm"] for a in result[NOMINAL]["summary"]["approaches"]]
        locations = location + 0.16 * (np.arange(len(nominal)) - (len(approaches) - 1) / 2)
        axes.plot(locations, nominal, "x", color="black", ms=5)
        for number, approach in enumerate(approaches):
            x = location + 0.16 * (number - (len(approaches) - 1) / 2)
            colour = pick(number)
            face = colour if approach["grasped"] else "none"
            axes.bar(x, approach["hand_distance_mm"], 0.14, color=face, edgecolor=colour)
            axes.annotate(f"{number + 1}", (x, approach["hand_distance_mm"]), ha="center",
                          va="bottom", fontsize=7)  # fmt: skip
    axes.axhline(CAN_RADIUS_MM, color="0.4", ls="--", lw=1)
    axes.set_xticks(range(len(results)), [f"robot {seed}" for seed in results])
    axes.set_ylabel("hand off its target [mm]")
    axes.set_xlim(-0.6, len(results) - 0.4)
    axes.margins(y=0.15)


def pick(number: int) -> str:
    """Colour of an approach by its number."""
    return ("#c8452f", "#d39a2a", "#3a6fb5", "#3f8f3f")[number % 4]


def _lengths(pyplot: Any, curves: Mapping[str, Any]) -> Any:
    before, after = np.array(curves["lengths_before"]), np.array(curves["lengths_after"])
    figure, grid = pyplot.subplots(2, 5, figsize=(11, 4.6), sharex=True)
    for i, (axes, muscle) in enumerate(zip(grid.flat, curves["muscles"], strict=True)):
        axes.plot(curves["pitch"], before[:, i], "--", color="0.4", lw=1.2, label="before")
        axes.plot(curves["pitch"], after[:, i], color="#c8452f", lw=1.4, label="after")
        axes.set_title(muscle, fontsize=9)
        axes.tick_params(labelsize=7)
    for axes in grid[1]:
        axes.set_xlabel("shoulder pitch [deg]", fontsize=8)
    for axes in grid[:, 0]:
        axes.set_ylabel("length [mm]", fontsize=8)
    handles = grid[0, 0].get_legend_handles_labels()
    figure.legend(*handles, loc="upper center", ncol=2, fontsize=8)
    figure.tight_layout(rect=(0, 0, 1, 0.95))
    return figure
