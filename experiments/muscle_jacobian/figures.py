"""Figures of the muscle Jacobians: shoulder flexion, and errors and turns of all maps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes

from experiments.harness.experiment import Results
from experiments.harness.report import Picture, png
from experiments.harness.statistics import interval
from experiments.initial_training.flexion import Flexion
from experiments.muscle_jacobian.moment_arms import ANALYTIC, KINDS, QUADRATIC, TRUE
from experiments.muscle_jacobian.tables import PARTS, STAGES, Stage, over_seeds
from kengoro.trained_maps import nominal_model

COLOURS = {ANALYTIC: "#D55E00", QUADRATIC: "#0072B2", TRUE: "black"}

NOTE = (
    "Moment arms of the ten shoulder muscles about the shoulder pitch, which moves through its "
    "range while all other joints are at zero. Solid: map; dotted: true."
)


def pictures(results: Results) -> list[Picture]:
    """Figure of the paper before and after learning, and a summary."""
    first, result = next(iter(results.items()))
    before = [stage for stage in STAGES if stage.evaluated == "nominal"]
    after = [stage for stage in STAGES if stage.evaluated == "after"]
    found = [
        Picture(
            f"Muscle Jacobian during shoulder flexion, before learning, seed {first}",
            _flexion_figure(before, result),
            NOTE,
        ),
        Picture(
            f"Muscle Jacobian during shoulder flexion, after learning, robot {first}",
            _flexion_figure(after, result),
            NOTE + " True moment arms are those of the robot.",
        ),
        Picture(
            "Error and turns of both Jacobians on all maps",
            _summary_figure(results),
            "Sweeps of all joints from random postures. Medians over robots with their 95 % "
            "intervals.",
        ),
    ]
    pyplot.close("all")
    return found


def _flexion_figure(stages: Sequence[Stage], result: dict[str, Any]) -> bytes:
    """Moment arms with a row for each stage: analytic left, quadratic right."""
    flexion = Flexion(nominal_model())
    rows = len(stages)
    figure, axes = pyplot.subplots(
        rows, 2, figsize=(12, 0.6 + 3.6 * rows), sharex=True, sharey=True, squeeze=False
    )
    for row, stage in zip(axes, stages, strict=True):
        arms = result[stage.condition][stage.evaluated]["flexion"]
        for ax, kind in zip(row, KINDS, strict=True):
            _draw(ax, flexion, np.array(arms[kind]), np.array(arms[TRUE]))
            ax.set_title(f"{kind}: {stage.title}", fontsize=10)
        row[0].set_ylabel("dl/dtheta [mm/rad]")
    for ax in axes[-1]:
        ax.set_xlabel("shoulder pitch [deg] (raised forward at the left)")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.tight_layout(rect=(0.0, 0.0, 0.88, 1.0))
    figure.legend(handles, labels, loc="center right", fontsize=9)
    return png(figure)


def _draw(axes: Axes, flexion: Flexion, arms: np.ndarray, true: np.ndarray) -> None:
    for number, name in enumerate(flexion.names):
        axes.plot(flexion.degrees, arms[:, number], color=f"C{number}", lw=1.3, label=name)
        label = "true" if number == len(flexion.names) - 1 else None
        axes.plot(flexion.degrees, true[:, number], ":", color="black", lw=1.1, label=label)
    axes.grid(alpha=0.3)


def _summary_figure(results: Results) -> bytes:
    """Error (top) and turns (bottom) in the whole range (left) and its inner part (right)."""
    figure, axes = pyplot.subplots(2, 2, figsize=(12, 7.5), sharey="row", sharex=True)
    for column, part in enumerate(PARTS):
        _bars(axes[0, column], results, "error", part, KINDS)
        _bars(axes[1, column], results, "turns", part, (*KINDS, TRUE))
        axes[0, column].set_title(f"over {PARTS[part]}\nnominal model | robot", fontsize=10)
    axes[0, 0].set_ylabel("RMS error of moment arms [mm/rad]")
    axes[1, 0].set_ylabel("turns per sweep and muscle")
    handles, labels = axes[1, 0].get_legend_handles_labels()
    figure.tight_layout(rect=(0.0, 0.0, 1.0, 0.95))
    figure.legend(handles, labels, loc="upper center", ncols=3)
    return png(figure)


def _bars(axes: Axes, results: Results, name: str, part: str, kinds: Sequence[str]) -> None:
    width = 0.8 / len(kinds)
    for number, kind in enumerate(kinds):
        found = [interval(over_seeds(results, stage, kind, name, part)) for stage in STAGES]
        medians = np.array([of.median for of in found])
        reach = [medians - [of.low for of in found], [of.high for of in found] - medians]
        locations = np.arange(len(STAGES)) + (number - (len(kinds) - 1) / 2) * width
        axes.bar(locations, medians, 0.9 * width, yerr=reach, color=COLOURS[kind], label=kind,
                 capsize=2, ecolor="grey")  # fmt: skip
    axes.set_xticks(np.arange(len(STAGES)), [stage.short for stage in STAGES], fontsize=8)
    nominal = sum(stage.truth == "nominal" for stage in STAGES)
    axes.axvline(nominal - 0.5, color="grey", lw=0.8)
    axes.grid(axis="y", alpha=0.3)
