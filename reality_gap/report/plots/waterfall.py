"""Waterfall: what tolerances and causes remove from the error of held-out data, in turn."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from reality_gap.diagnosis import Share
from reality_gap.report.formatting import capital, number, probability
from reality_gap.report.plots.canvas import AFTER, BEFORE, FLOOR, QUIET, figure, label_rows

LONGEST = 45
"""Largest number of characters of a name."""


def waterfall(steps: Sequence[Share], floor: float, others: int = 0) -> Figure:
    """Plot the error of the model, what removes it, what remains, and the noise.

    Args:
        steps: what removes the error, in this order.
        floor: RMS of the noise.
        others: number of the first steps that are no causes.
    """
    made, axes = figure(9, 1.3 + 0.42 * (len(steps) + 3))
    ax = axes[0, 0]
    before, after = steps[0].before, steps[-1].after
    widest = max(before, floor, *(step.after for step in steps))
    names = ["error of your model", *(capital(step.part) for step in steps)]
    ax.barh(0, before, color=BEFORE)
    ax.annotate(f" {number(before)}", (before, 0), va="center", fontsize=9)
    for row, step in enumerate(steps, 1):
        colour = QUIET if row <= others else AFTER
        ax.barh(row, step.before - step.after, left=step.after, color=colour)
        ax.plot([step.before] * 2, [row - 1.0, row], color="#888888", lw=0.8, zorder=0)
        text = f" {number(step.before)} to {number(step.after)}, {_taken(step)}"
        ax.annotate(text, (max(step.before, step.after), row), va="center", fontsize=9)
    last = len(steps) + 1
    for row, size, colour in ((last, after, BEFORE), (last + 1, floor, FLOOR)):
        ax.barh(row, size, color=colour)
        ax.annotate(f" {number(size)}", (size, row), va="center", fontsize=9)
    ax.axvline(floor, color=FLOOR, lw=1.2, ls="--", zorder=0)
    ax.set_xlim(0.0, 1.45 * widest)
    ax.set_xlabel(
        "RMS of the residual on held-out data [standard deviations of noise], and share of the\n"
        "power of the error above the noise that each part removes",
        fontsize=9,
    )
    label_rows(ax, [_short(name) for name in (*names, "what remains", "noise of the sensors")])
    return made


def _taken(step: Share) -> str:
    """Return what a step removes, in words."""
    if step.fraction < 0.0:
        return "grows"
    return probability(step.fraction)


def _short(name: str) -> str:
    return name if len(name) <= LONGEST else f"{name[: LONGEST - 3]}..."
