"""Remainder: the error that is not explained, and the quantities that it depends on."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reality_gap.diagnosis import Dependence
from reality_gap.report.formatting import probability
from reality_gap.report.plots.canvas import AFTER, LEARNED, QUIET, figure, label_rows

MOST = 8
"""Largest number of quantities in the picture."""


def remainder(
    label: str, named: float, explainable: float, depends_on: tuple[Dependence, ...]
) -> Figure:
    """Plot the explained shares of the error above the noise, and what the rest depends on.

    Args:
        label: name of the causes, such as "named causes".
        named: share that they explain, 0 to 1.
        explainable: share that a learned residual would explain, 0 to 1.
        depends_on: quantities that the remaining error depends on.
    """
    listed = depends_on[:MOST]
    heights = [1.0, 0.6 + 0.3 * len(listed)] if listed else [1.0]
    made, axes = figure(9, sum(heights) + 0.7, len(heights), 1, height_ratios=heights)
    _shares(axes[0, 0], label, named, explainable)
    if listed:
        ax = axes[1, 0]
        for row, dependence in enumerate(listed):
            ax.barh(row, 100.0 * dependence.fraction, color=LEARNED)
            text = f" {probability(dependence.fraction)}, in {dependence.channel}"
            ax.annotate(text, (100.0 * dependence.fraction, row), va="center", fontsize=8)
        ax.set_xlim(0.0, 100.0)
        ax.set_xlabel(
            "share of the remaining error that it predicts on held-out data [%]", fontsize=9
        )
        label_rows(ax, [dependence.quantity for dependence in listed])
    return made


def _shares(ax: Axes, causes: str, named: float, explainable: float) -> None:
    named = min(max(named, 0.0), 1.0)
    learned = max(min(explainable, 1.0) - named, 0.0)
    parts = (
        (named, AFTER, causes),
        (learned, LEARNED, "added by a learned residual (upper bound, no cause)"),
        (1.0 - named - learned, QUIET, "neither"),
    )
    left = 0.0
    for share, colour, label in parts:
        ax.barh(0, 100.0 * share, left=left, color=colour, label=f"{label}: {probability(share)}")
        left += 100.0 * share
    ax.set_xlim(0.0, 100.0)
    ax.set_yticks([])
    ax.spines["left"].set_visible(False)
    ax.set_xlabel("share of the error above the noise [%]", fontsize=9)
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, fontsize=8, frameon=False)
