"""Gain: residual of each channel on held-out data, before and after the extension."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from reality_gap.report.plots.canvas import AFTER, BEFORE, FLOOR, QUIET, SPLITS, figure, label_rows
from reality_gap.report.plots.signals import Signal, changed

REPORT = [name for name, _ in SPLITS].index("report")
"""Number of the held-out data in `Signal.split`."""
MOST = 30
"""Largest number of rows."""


def held_out(signal: Signal, which: str) -> float:
    """Return the RMS of a channel's residual on held-out data, in units of noise; NaN without any.

    Args:
        signal: the channel.
        which: "before" or "after".
    """
    residual = signal.residual(which)[signal.split == REPORT]
    return float(np.sqrt(np.mean(residual**2))) if len(residual) else float("nan")


def channel_gain(found: list[Signal], total: tuple[float, float], floor: float) -> Figure:
    """Plot the residual of all channels together and of each channel, before and after.

    Args:
        found: the channels.
        total: RMS of all channels before and after, in units of noise.
        floor: RMS that the noise alone would leave.
    """
    values = [(s.name, held_out(s, "before"), held_out(s, "after")) for s in found]
    rows = [("all channels", *total), *(row for row in values if np.isfinite(row[1]))][:MOST]
    made, axes = figure(9, 1.2 + 0.26 * len(rows))
    ax = axes[0, 0]
    y = range(len(rows))
    before, after = [row[1] for row in rows], [row[2] for row in rows]
    ax.axvline(floor, color=FLOOR, lw=2, label="floor: the noise of the sensors")
    ax.hlines(y, after, before, color=QUIET, lw=3)
    ax.plot(before, y, "o", color=BEFORE, label="your model")
    if changed(found):
        ax.plot(after, y, "o", color=AFTER, label="extended model")
    ax.set_xscale("log")
    ax.set_xlim(0.7 * min([floor, *before, *after]), 1.3 * max([3.0, *before, *after]))
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.grid(axis="x", alpha=0.3)
    ax.set_xlabel("RMS of the residual on held-out data [standard deviations of noise]", fontsize=9)
    label_rows(ax, [row[0] for row in rows])
    made.legend(loc="outside upper left", ncols=3, fontsize=8)
    return made
