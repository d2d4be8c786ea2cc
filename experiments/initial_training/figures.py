"""Figures of the initial training: loss transition, and lengths during shoulder flexion."""

from __future__ import annotations

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes

from experiments.harness.experiment import Results
from experiments.harness.report import GROUP_COLOURS, Picture, png
from experiments.initial_training.flexion import Flexion
from jmm_agent.types import Floats
from kengoro.trained_maps import nominal_model

OURS, PAPER = "ours", "paper"
COLOURS = {OURS: "#0072B2", PAPER: "#D55E00"}
NAMES = {OURS: "our training", PAPER: "the paper's recipe"}
GOAL = 1.0
"""Upper bound of the RMSE of the paper's training [mm]."""


def pictures(results: Results) -> list[Picture]:
    """Figure of the paper, loss of all groups, and errors during flexion."""
    first, result = next(iter(results.items()))
    nominal = nominal_model()
    flexion = Flexion(nominal)
    true = flexion.lengths(nominal.lengths)
    found = {name: np.array(result[name]["flexion"]) for name in NAMES}
    pictures = [
        Picture(
            f"Loss transition of the shoulder, and its muscles during flexion, training {first}",
            _paper_figure(results, flexion, found[OURS], true),
            "Left: RMSE of lengths during training, one line a seed: ours over each 250 steps, the "
            "paper's on postures held out; dot: ours after training on random postures. Right: "
            "our network and the geometric model.",
        ),
        Picture(
            "Loss transition in every group",
            _groups_figure(results),
            "RMSE of lengths over the Adam steps. Vertical line: end of the paper's 20 epochs, "
            "which have fewer steps in groups with a smaller grid.",
        ),
        Picture(
            f"Network - geometric model during flexion, training {first}",
            _error_figure(flexion, {name: lengths - true for name, lengths in found.items()}),
        ),
    ]
    pyplot.close("all")
    return pictures


def _paper_figure(results: Results, flexion: Flexion, found: Floats, true: Floats) -> bytes:
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(12, 4.8))
    for condition, name in NAMES.items():
        for number, result in enumerate(results.values()):
            group = result[condition]["groups"]["shoulder"]
            label = name if number == 0 else None
            left.plot(group["epochs"], group["loss"], color=COLOURS[condition], lw=0.9, label=label)
            if condition == OURS:
                label = "our training, final" if number == 0 else None
                end = group["epochs"][-1], group["rmse"]
                left.plot(*end, "o", color=COLOURS[OURS], ms=4, label=label)
    _loss_axes(left)
    left.set_xticks(range(0, 21, 5))
    left.set_xlabel("epoch")
    left.legend(fontsize=9)
    for number, name in enumerate(flexion.names):
        colour = f"C{number}"
        right.plot(flexion.degrees, found[:, number], color=colour, label=name)
        right.plot(flexion.degrees, true[:, number], ":", color="black", lw=1.2)
    right.plot([], [], ":", color="black", label="geometric model")
    _flexion_axes(right)
    right.set_ylabel("muscle length [mm]")
    right.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.tight_layout()
    return png(figure)


def _groups_figure(results: Results) -> bytes:
    figure, axes = pyplot.subplots(1, 4, figsize=(13, 3.8), sharey=True)
    _, first = next(iter(results.items()))
    for ax, group in zip(axes, GROUP_COLOURS, strict=True):
        for condition, name in NAMES.items():
            for number, result in enumerate(results.values()):
                of = result[condition]["groups"][group]
                steps = np.array(of["epochs"]) * of["epoch_steps"]
                shown = steps > 0
                label = name if number == 0 else None
                ax.plot(
                    steps[shown],
                    np.array(of["loss"])[shown],
                    color=COLOURS[condition],
                    lw=0.9,
                    label=label,
                )
        ax.axvline(20 * first[PAPER]["groups"][group]["epoch_steps"], color="grey", lw=0.8)
        _loss_axes(ax)
        ax.set_xscale("log")
        ax.set_xlim(left=50)
        ax.set_xlabel("Adam steps")
        ax.set_title(group)
    for ax in axes[1:]:
        ax.set_ylabel("")
    axes[0].legend(fontsize=8, loc="lower left")
    figure.tight_layout()
    return png(figure)


def _loss_axes(axes: Axes) -> None:
    axes.set_yscale("log")
    axes.axhline(GOAL, color="black", ls="--", lw=0.8)
    axes.set_ylabel("RMSE [mm]")
    axes.grid(alpha=0.3)


def _error_figure(flexion: Flexion, errors: dict[str, Floats]) -> bytes:
    figure, axes = pyplot.subplots(1, 2, figsize=(12, 4), sharey=True)
    for ax, (condition, error) in zip(axes, errors.items(), strict=True):
        for number, name in enumerate(flexion.names):
            ax.plot(flexion.degrees, error[:, number], color=f"C{number}", label=name)
        ax.set_title(NAMES[condition])
        _flexion_axes(ax)
    axes[0].set_ylabel("error of muscle length [mm]")
    axes[1].legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.tight_layout()
    return png(figure)


def _flexion_axes(axes: Axes) -> None:
    axes.set_xlabel("shoulder pitch [deg] (raised forward at the left)")
    axes.grid(alpha=0.3)
