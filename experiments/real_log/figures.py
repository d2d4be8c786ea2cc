"""Figure of the log of a measured robot: errors by samples, and loops of hysteresis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.harness.report import Picture, png
from experiments.real_log.hysteresis import play_states
from experiments.real_log.machine import NAMES, TO_UNITS, UNITS
from experiments.real_log.tables import INSTRUMENT, SHEET, Trials, joint_errors, least_errors, whole
from experiments.real_log.trial import NOISY, OURS, STEADY
from jmm_agent.types import Floats

STYLES = {
    "constants": ("#8c6bb1", "--", "^"),
    "linear regression": ("#d39a2a", ":", "D"),
    "Gaussian process": ("#3f8f3f", ":", "P"),
    OURS: ("#c8452f", "--", "o"),
    STEADY: ("#c8452f", ":", "v"),
    NOISY: ("#c8452f", "-", "s"),
}
"""Colour, line and marker of each method."""
CEILING = 2.0
"""Largest error in the figure, in units of the data sheet's [1]."""
BINS = 12
"""Number of bins of the mean line."""


def picture(
    trials: Trials,
    floor: Mapping[str, Any],
    counts: Sequence[int],
    asked: Floats,
    missed: Floats,
) -> Picture:
    """Errors by the number of samples above, and what is left over the state of the play below.

    Args:
        trials: results of all starts.
        floor: spread at the same motor angles.
        counts: numbers of samples.
        asked: joint angles by the data sheet (N, 6) [rad].
        missed: measured joint angles minus those of our map of all samples (N, 6) [rad].
    """
    figure = Figure(figsize=(12, 7.5), layout="constrained")
    axes = figure.subplots(2, len(INSTRUMENT), squeeze=False)
    for (above, below), name in zip(axes.T, INSTRUMENT, strict=True):
        joint = NAMES.index(name)
        _errors(above, trials, floor, counts, joint)
        plays = [one["direction"][joint]["play"] for one in trials]
        _loop(below, asked[:, joint], missed[:, joint], float(np.median(plays)), joint)
    axes[0, 0].set_ylabel("RMS error [deg]")
    axes[1, 0].set_ylabel("measured - our map of all samples [deg]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4)
    note = (
        "Above: errors on the second half of the log, medians over starts. Below: samples of the "
        "second half over the state of a play, with the map of the first start; left of the middle "
        "the joint last moved downwards, right of it upwards. A map of motor angles alone cannot "
        "follow the line of means."
    )
    return Picture("Joint angles from lengths alone", png(figure), note)


def _errors(
    axes: Axes, trials: Trials, floor: Mapping[str, Any], counts: Sequence[int], joint: int
) -> None:
    """Errors of all methods by the number of samples."""
    for title, (colour, line, marker) in STYLES.items():
        found = [np.median(joint_errors(trials, title, count)[:, joint]) for count in counts]
        axes.plot(counts, found, line, marker=marker, color=colour, label=whole(title))
    sheet = float(np.median(joint_errors(trials, SHEET, counts[0])[:, joint]))
    least = least_errors(floor)[joint]
    axes.axhline(sheet, color="#222222", lw=1, label=SHEET)
    axes.axhline(least, color="#999999", lw=4, alpha=0.5, label="floor of any map")
    axes.set_ylim(0.0, CEILING * sheet)
    axes.set_xscale("log")
    axes.set_xticks(counts, [str(count) for count in counts])
    axes.minorticks_off()
    axes.set_title(NAMES[joint])
    axes.set_xlabel("samples to learn from")


def _loop(axes: Axes, asked: Floats, missed: Floats, play: float, joint: int) -> None:
    """What is left on the second half over the state of the play, with means of bins."""
    split = len(asked) // 2
    state = play_states(asked[:, None], play)[split:, 0] * TO_UNITS[joint]
    left = missed[split:] * TO_UNITS[joint]
    axes.plot(state, left, ".", ms=2, color="#3a6fb5", alpha=0.35)
    edges = np.linspace(state.min(), state.max(), BINS + 1)
    bins = np.clip(np.digitize(state, edges) - 1, 0, BINS - 1)
    means = [left[bins == one].mean() if (bins == one).any() else np.nan for one in range(BINS)]
    axes.plot(0.5 * (edges[1:] + edges[:-1]), means, "-o", color="#222222", ms=4)
    axes.axhline(0.0, color="#cccccc", lw=1, zorder=0)
    unit = UNITS[joint]
    axes.set_xlabel(f"state of a play of {play * TO_UNITS[joint]:.3g} {unit} each way [{unit}]")
