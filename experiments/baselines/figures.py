"""Figures of the baselines: errors by number of postures, kinds of fit, time."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator, ScalarFormatter

from experiments.baselines.tables import (
    GAUSSIAN,
    NO_LEARNING,
    OURS,
    POLYNOMIALS,
    TABLE,
    Numbers,
    middle,
)
from experiments.harness.report import Picture, png
from experiments.harness.statistics import interval

STYLES = {
    NO_LEARNING: ("#777777", "--", ""),
    POLYNOMIALS[2]: ("#9ecae1", "-", "v"),
    POLYNOMIALS[3]: ("#4292c6", "-", "^"),
    POLYNOMIALS[4]: ("#084594", "-", "s"),
    TABLE: ("#d39a2a", "-", "D"),
    GAUSSIAN: ("#3f8f3f", "-", "P"),
    OURS: ("#c8452f", "-", "o"),
}
"""Colour, line and marker of each method."""

PANELS = {
    "target_true_deg": "RMSE_joint, target - true [deg]",
    "estimate_seen_deg": "RMSE_joint, estimate - seen [deg]",
    "target_true_mm": "Distance_hand, target - true [mm]",
}


def pictures(
    by_count: Mapping[int, Numbers], together: Numbers, alone: Numbers, count: int
) -> list[Picture]:
    """All figures of the report."""
    return [
        Picture(
            "Errors by number of postures, by method",
            _finished(_curves(by_count)),
            "Medians over actual robots; bars: 95 % intervals of ours.",
        ),
        Picture(
            f"Observations fitted together and each alone, after {count} postures",
            _finished(_observations(together, alone)),
            "Medians over actual robots with 95 % intervals.",
        ),
        Picture(
            "Time of one update, by number of postures",
            _finished(_times(by_count)),
            "Medians over actual robots. The fit of observations is not included.",
        ),
    ]


def _finished(figure: Figure) -> bytes:
    data = png(figure)
    pyplot.close(figure)
    return data


def _curves(by_count: Mapping[int, Numbers]) -> Figure:
    figure, axes = pyplot.subplots(1, 3, figsize=(13, 4.8))
    counts = list(by_count)
    for ax, (outcome, label) in zip(axes, PANELS.items(), strict=True):
        for name, (colour, line, marker) in STYLES.items():
            medians = [middle(found, name, outcome) for found in by_count.values()]
            ax.plot(counts, medians, line, marker=marker, color=colour, label=name, ms=5)
        spans = [interval(found[OURS][outcome]) for found in by_count.values()]
        ax.vlines(counts, [s.low for s in spans], [s.high for s in spans], STYLES[OURS][0], lw=1.5)
        _counted(ax, counts)
        ax.set_yscale("log")
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.yaxis.set_major_formatter(ScalarFormatter())
        ax.yaxis.set_minor_locator(NullLocator())
        ax.set_ylabel(label)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", ncols=4, fontsize=9, frameon=False)
    figure.tight_layout(rect=(0, 0, 1, 0.88))
    return figure


def _counted(axes: pyplot.Axes, counts: list[int]) -> None:
    axes.set_xscale("log")
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticks(counts, [str(count) for count in counts])
    axes.set_xlabel("number of postures visited")
    axes.grid(alpha=0.3)


def _observations(together: Numbers, alone: Numbers) -> Figure:
    names = [name for name in STYLES if name != NO_LEARNING]
    figure, axes = pyplot.subplots(1, 2, figsize=(11, 4), sharey=True)
    location = np.arange(len(names))[::-1]
    for ax, outcome in zip(axes, ("target_true_deg", "estimate_seen_deg"), strict=True):
        for found, shift, label, shade in (
            (together, 0.2, "observations fitted together", 1.0),
            (alone, -0.2, "each observation alone", 0.45),
        ):
            spans = [interval(found[name][outcome]) for name in names]
            medians = np.array([span.median for span in spans])
            edges = np.abs(np.array([[s.low, s.high] for s in spans]).T - medians)
            ax.barh(
                location + shift,
                medians,
                0.38,
                xerr=edges,
                color="#3a6fb5",
                alpha=shade,
                label=label,
                error_kw={"capsize": 3, "lw": 1},
            )
        ax.set_xlabel(PANELS[outcome])
        ax.grid(axis="x", alpha=0.3)
    axes[0].set_yticks(location, names)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", ncols=2, fontsize=9, frameon=False)
    figure.tight_layout(rect=(0, 0, 1, 0.93))
    return figure


def _times(by_count: Mapping[int, Numbers]) -> Figure:
    figure, ax = pyplot.subplots(figsize=(7, 4.2))
    for name, (colour, line, marker) in STYLES.items():
        if name != NO_LEARNING:
            times = [middle(found, name, "update_ms") for found in by_count.values()]
            ax.plot(list(by_count), times, line, marker=marker, color=colour, label=name, ms=5)
    _counted(ax, list(by_count))
    ax.set_yscale("log")
    ax.set_ylabel("time of one update [ms of one core]")
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=9, frameon=False)
    figure.tight_layout()
    return figure
