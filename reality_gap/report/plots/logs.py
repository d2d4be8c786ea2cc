"""Values of a cause in each log, with the value of all logs and that of the model."""

from __future__ import annotations

from matplotlib.figure import Figure

from reality_gap.diagnosis import NamedCause
from reality_gap.report.formatting import human, shown
from reality_gap.report.plots.canvas import AFTER, FLOOR, LEARNED, figure, label_rows

MOST = 3
"""Largest number of parameters that are shown."""


def log_intervals(cause: NamedCause) -> Figure:
    """Plot the main parameters in each log with their 95 % intervals."""
    values = cause.logs.values if cause.logs else ()
    names = [n for n in cause.foremost() if any(n in value.parameters for value in values)][:MOST]
    made, axes = figure(9, 0.9 + 0.3 * len(values), 1, len(names), sharey=True)
    for ax, name in zip(axes[0], names, strict=True):
        common, parameter = cause.parameters[name], cause.candidate.parameter(name)
        factor, unit = shown(common.unit, common.value)
        ax.axvline(factor * parameter.null, color=FLOOR, lw=1.5, label="your model")
        if not cause.candidate.location.log:
            ax.axvline(factor * common.value, color=LEARNED, lw=1.5, label="in all logs")
        for row, value in enumerate(values):
            if name in value.parameters:
                one = value.parameters[name]
                ax.plot([factor * one.low, factor * one.high], [row, row], color=AFTER, lw=4)
                ax.plot(factor * one.value, row, "o", color=AFTER, ms=6)
        ax.set_xlabel(f"{human(name)} [{unit}]" if unit else human(name), fontsize=8)
        label_rows(ax, [value.log for value in values])
        ax.tick_params(axis="y", length=0)
    handles = axes[0, 0].get_legend_handles_labels()[0]
    made.legend(handles=handles, loc="outside upper left", ncols=2, fontsize=8)
    return made
