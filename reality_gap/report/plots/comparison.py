"""Comparison of a channel's residual with time, velocity, tension and posture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reality_gap.report.formatting import percent, shown
from reality_gap.report.plots.canvas import AFTER, BEFORE, MEASURED, figure
from reality_gap.report.plots.signals import Signal, changed
from reality_gap.types import Floats

BINS = 20
"""Largest number of bins."""
PER_BIN = 25
"""Smallest mean number of readings in a bin."""
MOST_POINTS = 3000
"""Largest number of points in a panel, about."""
ALIKE = 0.05
"""Largest difference of shares that count as equal; the channel with more readings is shown."""
KINDS = {"tension": ("N", "N m"), "posture": ("m", "rad")}
"""SI units of the channels of each kind of quantity."""


@dataclass(frozen=True)
class Quantity:
    """A quantity on which a residual may depend.

    Attributes:
        label: name and unit.
        value: values at the times of the residual, shape (k,), in the unit of the label.
        share: share of the variance of the residual that its means over bins of ``value`` explain,
            0 to 1.
        readings: number of readings of the channel from which the quantity comes.
    """

    label: str
    value: Floats
    share: float
    readings: int


def against(signal: Signal, others: list[Signal]) -> Figure:
    """Plot the residual of a channel against each quantity, with its means over bins.

    Args:
        signal: the channel.
        others: all channels, from which the quantities are taken.
    """
    residual = signal.residual("before")
    quantities = _quantities(signal, others, residual)
    made, axes = figure(11, 3.1, 1, len(quantities), sharey=True)
    for ax, quantity in zip(axes[0], quantities, strict=True):
        _draw(ax, signal, quantity)
    axes[0, 0].set_ylabel(f"residual of {signal.name}\n[standard deviations of noise]", fontsize=8)
    lines = axes[0, 0].get_lines()[1:]
    made.legend(handles=lines, loc="outside upper left", ncols=3, fontsize=8)
    return made


def constant_share(signal: Signal) -> float:
    """Return the share of the power of the model's residual that is constant."""
    residual = signal.residual("before")
    return float(residual.mean() ** 2 / max(float(np.mean(residual**2)), 1e-30))


def _quantities(signal: Signal, others: list[Signal], residual: Floats) -> list[Quantity]:
    """Return the time, and of each kind the quantity on which the residual depends most."""
    time = Quantity("time [s]", signal.time, _share(signal.time, residual), len(signal.time))
    found = [time]
    moving = [o for o in others if o.unit in KINDS["posture"] and len(o.time) > 2]
    velocities = [_at(o, signal, _rate(o), residual, "/s") for o in moving]
    for candidates in (
        velocities,
        [_at(o, signal, o.after, residual) for o in others if o.unit in KINDS["tension"]],
        [_at(o, signal, o.after, residual) for o in moving],
    ):
        if candidates:
            most = max(quantity.share for quantity in candidates) - ALIKE
            alike = [quantity for quantity in candidates if quantity.share >= most]
            found.append(max(alike, key=lambda quantity: quantity.readings))
    return found


def _at(other: Signal, signal: Signal, value: Floats, residual: Floats, per: str = "") -> Quantity:
    """Return another channel as a quantity, as simulated by the extended model without noise."""
    factor, unit = shown(other.unit + per)
    interpolated = factor * np.interp(signal.time, other.time, value)
    name = f"rate of {other.name}" if per else other.name
    share = _share(interpolated, residual)
    return Quantity(f"{name} [{unit}]", interpolated, share, len(other.time))


def _rate(other: Signal) -> Floats:
    """Return the rate of a channel within each episode, shape (k,); 0 in those with one reading."""
    found = np.zeros(len(other.time))
    for e in np.unique(other.episode):
        at = np.flatnonzero(other.episode == e)
        if len(at) > 1:
            steps = np.maximum(np.gradient(other.time[at]), 1e-9)
            found[at] = np.gradient(other.after[at]) / steps
    return found


def _bins(value: Floats) -> NDArray[np.int64]:
    """Return the bin of each value, shape (k,); bins have equal numbers of readings."""
    count = max(2, min(BINS, len(value) // PER_BIN))
    edges = np.quantile(value, np.linspace(0.0, 1.0, count + 1)[1:-1])
    return np.searchsorted(edges, value)


def _means(value: Floats, residual: Floats) -> tuple[Floats, Floats]:
    """Return the means of value and residual over each bin."""
    bins = _bins(value)
    count = np.bincount(bins, minlength=BINS)
    full = count > 0
    x = np.bincount(bins, value, minlength=BINS)[full] / count[full]
    return x, np.bincount(bins, residual, minlength=BINS)[full] / count[full]


def _share(value: Floats, residual: Floats) -> float:
    """Return the share of the variance that the means explain, less the share by chance."""
    bins = _bins(value)
    varying = residual - residual.mean()
    count = np.maximum(np.bincount(bins, minlength=BINS), 1)
    carried = float(np.sum(np.bincount(bins, varying, minlength=BINS) ** 2 / count))
    power = float(varying @ varying)
    used = len(np.unique(bins))
    return max(0.0, carried / power - used / len(residual)) if power > 0.0 else 0.0


def _draw(ax: Axes, signal: Signal, quantity: Quantity) -> None:
    stride = max(1, len(quantity.value) // MOST_POINTS)
    residual = signal.residual("before")
    ax.axhline(0.0, color="black", lw=0.8)
    ax.plot(
        quantity.value[::stride],
        residual[::stride],
        ".",
        ms=2,
        alpha=0.35,
        color=MEASURED,
        label="measured - your model",
    )
    ax.plot(*_means(quantity.value, residual), color=BEFORE, lw=2, label="its mean")
    if changed([signal]):
        after = _means(quantity.value, signal.residual("after"))
        ax.plot(*after, color=AFTER, lw=2, label="mean of measured - extended model")
    ax.set_xlim(*np.quantile(quantity.value, (0.002, 0.998)))
    ax.set_xlabel(quantity.label, fontsize=8)
    ax.set_title(f"explains {percent(quantity.share)} of the variation", fontsize=8, loc="left")
