"""Figures of the ablation: errors of all variants, and the effect of each change."""

from __future__ import annotations

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes

from experiments.ablation.tables import HEADS, Numbers, difference
from experiments.harness.report import Picture, png
from experiments.harness.statistics import Interval, interval
from experiments.robots.variants import DEFAULT, NONE, PAPER, VARIANTS

TRUE, SEEN = "#c8452f", "#3a6fb5"
REFERENCES = (PAPER, DEFAULT)


def pictures(found: Numbers) -> list[Picture]:
    """Effects on both errors, errors of all variants, effects on the map and on tension."""
    effects = _picture(found, ("target_true_deg", "estimate_seen_deg"))
    far = _picture(found, ("box_mm", "max_tension_N"))
    return [
        Picture(
            "Effect of each change on both errors",
            effects,
            "Variant - reference on the same robot: median over robots with its 95 % interval. "
            "A change left of 0 is an improvement.",
        ),
        Picture(
            "Errors of all variants",
            _errors(found),
            "Median over robots with its 95 % interval.",
        ),
        Picture(
            "Effect of each change on the map far from the learned postures, and on tension",
            far,
            "Map: its error in the whole joint ranges, compared with the robot's muscle lengths.",
        ),
    ]


def _changed(reference: str) -> list[str]:
    names = [n for n, variant in VARIANTS.items() if variant.reference == reference != n]
    return names[::-1]


def _picture(found: Numbers, outcomes: tuple[str, str]) -> bytes:
    """Differences from both references; a row for each reference, a column for each outcome."""
    counts = [len(_changed(reference)) for reference in REFERENCES]
    figure, axes = pyplot.subplots(
        2, 2, figsize=(11, 8), sharex="col", sharey="row", height_ratios=counts
    )
    for row, reference in zip(axes, REFERENCES, strict=True):
        names = _changed(reference)
        for ax, outcome in zip(row, outcomes, strict=True):
            gaps = [difference(found, name, reference, outcome) for name in names]
            _draw(ax, gaps, TRUE if outcome == outcomes[0] else SEEN)
            ax.axvline(0.0, color="black", lw=1)
        row[0].set_yticks(range(len(names)), [VARIANTS[name].description for name in names])
        row[0].set_title(f"change from {_title(reference)}", loc="left", fontsize=10)
    for ax, outcome in zip(axes[-1], outcomes, strict=True):
        ax.set_xlabel(f"difference of {HEADS[outcome]}")
    figure.tight_layout()
    data = png(figure)
    pyplot.close(figure)
    return data


def _title(reference: str) -> str:
    return "the paper's plain rule" if reference == PAPER else "the default"


def _errors(found: Numbers) -> bytes:
    """Both errors of every variant."""
    names = [*VARIANTS, NONE][::-1]
    figure, ax = pyplot.subplots(figsize=(9, 7.5))
    for shift, (key, colour) in zip(
        (0.15, -0.15), (("target_true_deg", TRUE), ("estimate_seen_deg", SEEN)), strict=True
    ):
        _draw(ax, [interval(found[name][key]) for name in names], colour, shift, HEADS[key])
    ax.set_yticks(range(len(names)), names)
    ax.set_xlim(left=0)
    ax.set_xlabel("RMSE_joint [deg]")
    figure.legend(loc="upper right", ncols=2, fontsize=9, frameon=False)
    figure.tight_layout(rect=(0, 0, 1, 0.96))
    data = png(figure)
    pyplot.close(figure)
    return data


def _draw(
    axes: Axes, found: list[Interval], colour: str, shift: float = 0.0, label: str | None = None
) -> None:
    """Medians with their intervals, one in each row."""
    height = np.arange(len(found)) + shift
    median = np.array([gap.median for gap in found])
    spread = np.abs(np.array([[gap.low, gap.high] for gap in found]).T - median)
    axes.errorbar(median, height, xerr=spread, fmt="o", color=colour, capsize=3, label=label)
    axes.grid(axis="x", alpha=0.3)
