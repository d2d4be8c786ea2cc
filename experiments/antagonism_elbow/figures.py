"""Figures of the experiment on the Antagonism Updater."""

from __future__ import annotations

from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes

from experiments.harness.experiment import Results
from experiments.harness.report import Picture, png
from experiments.robots.conditions import ACTUAL, NOMINAL
from experiments.robots.elbow import MUSCLES

COLOURS = ("#0072B2", "#009E73", "#D55E00")
PAPER_N = (370.0, 250.0)


def pictures(results: Results) -> list[Picture]:
    """Tensions of one robot over all trials; largest tension and angle of all robots by trial."""
    first, result = next(iter(results.items()))
    figure, axes = pyplot.subplots(figsize=(11, 3.8))
    draw_tensions(axes, result[ACTUAL]["ours"])
    figure.tight_layout()
    found = [
        Picture(
            f"Muscle tensions during elbow flexion, robot {first}",
            png(figure),
            "Trial 0 is without learning, the others are with the Antagonism Updater. Each moves "
            "to 30, 60 and 90 deg; the return to zero is not shown.",
        )
    ]
    figure, (largest, angle) = pyplot.subplots(1, 2, figsize=(11, 4))
    draw_largest(largest, results)
    draw_angles(angle, results)
    figure.tight_layout()
    found.append(
        Picture(
            "Largest tension of each trial, and true angle at a target of 90 deg",
            png(figure),
            "Thin: one robot each; thick: median over robots. Dots: numbers of the paper.",
        )
    )
    pyplot.close("all")
    return found


def draw_tensions(axes: Axes, trials: list[dict[str, Any]]) -> None:
    """Draw the tensions of the three muscles over consecutive trials."""
    curves = [np.array(trial["curve"]) for trial in trials]
    for muscle, (name, colour) in enumerate(zip(MUSCLES, COLOURS, strict=True)):
        for number, curve in enumerate(curves):
            x = number + np.linspace(0.0, 1.0, len(curve), endpoint=False)
            label = name if number == 0 else None
            axes.plot(x, curve[:, muscle], color=colour, lw=1, label=label)
    for number in range(len(curves)):
        axes.axvline(number, color="0.85", lw=0.8, zorder=0)
    axes.set_xticks(np.arange(len(curves)) + 0.5, [f"{n}" for n in range(len(curves))])
    axes.set_xlim(0, len(curves))
    axes.set_ylim(bottom=0)
    axes.set_xlabel("trial")
    axes.set_ylabel("muscle tension [N]")
    axes.legend(loc="upper right")


def draw_largest(axes: Axes, results: Results) -> None:
    """Draw the largest tension of each trial with each rule."""
    runs = (
        ("ours", ACTUAL, "ours", "#0072B2", "-"),
        ("paper", ACTUAL, "the paper's minibatch steps", "#D55E00", "-"),
        ("off", ACTUAL, "no learning", "0.4", "--"),
        ("ours", NOMINAL, "ours, robots without departures", "#009E73", ":"),
    )
    for name, condition, label, colour, style in runs:
        curves = np.array([[t["largest"] for t in r[condition][name]] for r in results.values()])
        if condition == ACTUAL and name == "ours":
            axes.plot(curves.T, color=colour, lw=0.6, alpha=0.5)
        axes.plot(np.median(curves, axis=0), style, color=colour, lw=2.2, label=label)
    count = curves.shape[1]
    axes.plot([0, count - 1], PAPER_N, "o", color="black", label="paper")
    axes.set_ylim(0, 600)  # room for the legend
    axes.set_xlabel("trial")
    axes.set_ylabel("largest muscle tension [N]")
    axes.legend(fontsize=8, loc="upper right")


def draw_angles(axes: Axes, results: Results) -> None:
    """Draw the true and the estimated angle at the end of each trial, at a target of 90 deg."""
    trials = [result[ACTUAL]["ours"] for result in results.values()]
    for key, colour in (("true", "#0072B2"), ("estimate", "0.4")):
        curves = np.array([[trial[key][-1] for trial in robot] for robot in trials])
        axes.plot(curves.T, color=colour, lw=0.6, alpha=0.5)
        axes.plot(np.median(curves, axis=0), color=colour, lw=2.2, label=key)
    axes.axhline(90.0, color="black", ls="--", lw=1, label="target")
    axes.set_xlabel("trial")
    axes.set_ylabel("elbow angle [deg]")
    axes.legend(fontsize=8)
