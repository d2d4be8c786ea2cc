"""Signals: measured and simulated channels, and when the model misses them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from reality_gap.diagnosis import Trace
from reality_gap.report.formatting import shown
from reality_gap.report.plots.canvas import (
    AFTER,
    BEFORE,
    MEASURED,
    SPLITS,
    figure,
    label_rows,
    shade,
)
from reality_gap.types import Floats

BINS = 120
"""Number of intervals of time in the residual map."""
MOST_ROWS = 24
"""Largest number of channels in the residual map."""
WORST = 3
"""Number of channels whose traces are shown."""
ZOOM = 3.0
"""Duration of the enlarged part of a trace [s]."""


@dataclass(frozen=True)
class Signal:
    """A channel in all episodes, where both replays are finite.

    Attributes:
        name: name of the channel.
        unit: its SI unit.
        noise: standard deviation of one reading.
        time: time with each episode after the previous one, shape (k,) [s].
        episode: index of the episode, shape (k,).
        split, measured, before, after: shape (k,); as in `Trace`.
    """

    name: str
    unit: str
    noise: float
    time: Floats
    episode: NDArray[np.int64]
    split: NDArray[np.int64]
    measured: Floats
    before: Floats
    after: Floats

    def residual(self, which: str) -> Floats:
        """Return measured minus "before" or "after" in units of the noise, shape (k,)."""
        return (self.measured - getattr(self, which)) / self.noise

    def rms(self, which: str) -> float:
        """Return the RMS of the residual over the whole log, in units of the noise."""
        return float(np.sqrt(np.mean(self.residual(which) ** 2)))


def starts(traces: tuple[Trace, ...]) -> dict[str, float]:
    """Return the begin of each episode if each follows the previous one [s]."""
    lengths: dict[str, float] = {}
    for trace in traces:
        end = float(trace.time[-1]) if len(trace.time) else 0.0
        lengths[trace.episode] = max(lengths.get(trace.episode, 0.0), end)
    begins = np.cumsum([0.0, *lengths.values()])[:-1]
    return dict(zip(lengths, begins.tolist(), strict=True))


def signals(traces: tuple[Trace, ...]) -> list[Signal]:
    """Return all channels with finite replays, those with the largest residuals first."""
    begin = starts(traces)
    found = []
    for name in dict.fromkeys(trace.channel for trace in traces):
        own = [t for t in traces if t.channel == name]
        before = np.concatenate([t.before for t in own])
        after = np.concatenate([t.after for t in own])
        good = np.isfinite(before) & np.isfinite(after)
        if good.any():
            time = np.concatenate([t.time + begin[t.episode] for t in own])
            episode = np.repeat(range(len(own)), [len(t.time) for t in own])
            split = np.concatenate([t.split for t in own])
            measured = np.concatenate([t.measured for t in own])
            parts = (a[good] for a in (time, episode, split, measured, before, after))
            found.append(Signal(name, own[0].unit, own[0].noise, *parts))
    return sorted(found, key=lambda signal: -signal.rms("before"))


def changed(found: list[Signal]) -> bool:
    """Return whether the predictions of the extended model differ from those of the model."""
    return any(not np.array_equal(signal.before, signal.after) for signal in found)


def residual_map(found: list[Signal]) -> Figure:
    """Plot channels over time, coloured by the RMS of their residuals before and after."""
    rows = found[:MOST_ROWS]
    end = max(float(signal.time[-1]) for signal in rows)
    titles = {"before": "your model", "after": "extended model"}
    which = list(titles) if changed(found) else ["before"]
    made, axes = figure(11, 1.1 + 0.24 * max(4, len(rows)), 1, len(which), sharey=True)
    for ax, name in zip(axes[0], which, strict=True):
        image = ax.imshow(
            np.array([_binned(signal, name, end) for signal in rows]),
            aspect="auto",
            extent=(0.0, end, len(rows) - 0.5, -0.5),
            norm=LogNorm(1.0, max(10.0, rows[0].rms("before") * 2.0)),
            cmap="YlOrRd",
            interpolation="none",
        )
        ax.set_title(titles[name], loc="left", fontsize=10)
        ax.set_xlabel("time [s]", fontsize=9)
    label_rows(axes[0, 0], [signal.name for signal in rows])
    axes[0, 0].set_ylim(len(rows) - 0.5, -0.5)
    bar = made.colorbar(image, ax=list(axes[0]), pad=0.02, aspect=30, format="{x:g}")
    bar.set_label("residual\n[noise sd]", fontsize=8)
    return made


def _binned(signal: Signal, which: str, end: float) -> Floats:
    """Return the RMS in each bin, at least 1; a bin without readings has that of a near one."""
    bins = np.minimum((signal.time / end * BINS).astype(int), BINS - 1)
    count = np.bincount(bins, minlength=BINS)
    power = np.bincount(bins, signal.residual(which) ** 2, minlength=BINS)
    rms: Floats = np.full(BINS, np.nan)
    np.divide(power, count, out=rms, where=count > 0)
    centre = (np.arange(BINS) + 0.5) * end / BINS
    middle = (signal.time[1:] + signal.time[:-1]) / 2
    nearest = np.searchsorted(middle, centre)
    period = float(np.median(np.diff(signal.time))) if len(middle) else 0.0
    close = (count == 0) & (np.abs(signal.time[nearest] - centre) <= period)
    rms[close] = rms[bins[nearest[close]]]
    return np.clip(np.sqrt(rms), 1.0, None)


def time_traces(found: list[Signal], begin: dict[str, float]) -> Figure:
    """Plot the worst channels and their residuals, in the whole log and enlarged.

    Args:
        found: channels, the worst first.
        begin: begin of each episode [s].
    """
    worst = found[:WORST]
    rows = 2 * len(worst)
    made, axes = figure(
        11,
        2.7 * len(worst) + 0.5,
        rows,
        2,
        width_ratios=(1.5, 1),
        height_ratios=(1.7, 1) * len(worst),
    )
    extended = changed(found)
    for i, signal in enumerate(worst):
        _signal_rows(axes[2 * i : 2 * i + 2], signal, list(begin.values())[1:], extended)
    axes[0, 1].set_title("where the residual is largest", loc="left", fontsize=8)
    for ax in axes[-1]:
        ax.set_xlabel("time [s]", fontsize=9)
    handles, names = axes[0, 0].get_legend_handles_labels()
    lines = list(dict(zip(names, handles, strict=True)).values())
    patches = [Patch(color=colour, label=f"data to {name}") for name, colour in SPLITS]
    made.legend(handles=[*lines, *patches], loc="outside upper left", ncols=6, fontsize=8)
    return made


def _signal_rows(axes: NDArray[Any], signal: Signal, borders: list[float], extended: bool) -> None:
    """Plot a signal and its residual, the whole log left and its worst part right."""
    factor, unit = shown(signal.unit)
    low, high = _worst_window(signal)
    inside = (signal.time >= low) & (signal.time <= high)
    for ax in axes[0]:
        _lines(ax, signal, factor, extended)
    for ax in axes[1]:
        _residuals(ax, signal, extended)
    for ax in axes[0]:
        ax.tick_params(labelbottom=False)
    for left, right in axes:
        left.set_xlim(signal.time[0], signal.time[-1])
        shade(left, signal.time, signal.split, height=0.05)
        left.axvspan(low, high, color="black", alpha=0.06, lw=0)
        for border in borders:
            left.axvline(border, color="black", lw=0.8, ls=":")
        right.set_xlim(low, high)
        shade(right, signal.time[inside], signal.split[inside])
    axes[0, 1].set_ylim(*_limits(signal, inside, factor))
    axes[0, 0].set_ylabel(f"{signal.name}\n[{unit}]" if unit else signal.name, fontsize=8)
    axes[1, 0].set_ylabel("residual\n[noise sd]", fontsize=8)


def _lines(ax: Axes, signal: Signal, factor: float, extended: bool) -> None:
    for episode in np.unique(signal.episode):
        at = signal.episode == episode
        time = signal.time[at]
        ax.plot(time, factor * signal.measured[at], ".", ms=2.5, color=MEASURED, label="measured")
        ax.plot(time, factor * signal.before[at], color=BEFORE, lw=1.2, label="your model")
        if extended:
            ax.plot(time, factor * signal.after[at], color=AFTER, lw=1.2, label="extended model")


def _residuals(ax: Axes, signal: Signal, extended: bool) -> None:
    ax.axhline(0.0, color="black", lw=0.8)
    ax.plot(signal.time, signal.residual("before"), ".", ms=2, color=BEFORE)
    if extended:
        ax.plot(signal.time, signal.residual("after"), ".", ms=2, color=AFTER)


def _worst_window(signal: Signal) -> tuple[float, float]:
    """Return begin and end of the `ZOOM` seconds with the largest residual in one episode [s]."""
    power = np.r_[0.0, np.cumsum(signal.residual("before") ** 2)]
    ends = np.searchsorted(signal.time, signal.time + ZOOM)
    inside = signal.episode[np.minimum(ends, len(ends) - 1)] == signal.episode
    inside &= ends < len(ends)
    if not inside.any():
        first = signal.time[signal.episode == signal.episode[0]]
        return float(first[0]), float(first[-1])
    total = np.where(inside, power[ends] - power[:-1], -1.0)
    low = float(signal.time[int(np.argmax(total))])
    return low, low + ZOOM


def _limits(signal: Signal, inside: NDArray[np.bool_], factor: float) -> tuple[float, float]:
    """Return limits of the y axis that fit the signals in the enlarged part."""
    values = factor * np.concatenate(
        [signal.measured[inside], signal.before[inside], signal.after[inside]]
    )
    low, high = float(values.min()), float(values.max())
    margin = 0.07 * (high - low) + 1e-9
    return low - margin, high + margin
