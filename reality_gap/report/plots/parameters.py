"""Parameters of the named causes, compared with the values of the model."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reality_gap.causes.base import Parameter
from reality_gap.diagnosis import Estimate, NamedCause
from reality_gap.report.formatting import human, shown
from reality_gap.report.plots.canvas import AFTER, FLOOR, figure


def intervals(causes: tuple[NamedCause, ...]) -> Figure:
    """Plot the main parameters with their 95 % intervals, and the values of the model."""
    rows = [
        (cause, parameter, cause.parameters[parameter.name])
        for cause in causes
        for parameter in cause.candidate.parameters
        if parameter.name in cause.foremost()
    ]
    made, axes = figure(9, 0.55 + 0.72 * len(rows), len(rows), 1)
    for ax, (cause, parameter, estimate) in zip(axes[:, 0], rows, strict=True):
        _row(ax, parameter, estimate)
        name = human(cause.candidate.cause.id)
        ax.set_yticks([0.0], [f"{name}\n{human(parameter.name)}"], fontsize=8)
        ax.tick_params(axis="y", length=0)
    made.legend(
        handles=axes[0, 0].get_legend_handles_labels()[0],
        loc="outside upper left",
        ncols=3,
        fontsize=8,
    )
    return made


def _row(ax: Axes, parameter: Parameter, estimate: Estimate) -> None:
    factor, unit = shown(estimate.unit, estimate.value)
    value, low, high = (factor * x for x in (estimate.value, estimate.low, estimate.high))
    null, tolerance = factor * parameter.null, abs(factor * parameter.tolerance)
    ax.axvspan(
        null - tolerance,
        null + tolerance,
        color=FLOOR,
        alpha=0.25,
        lw=0,
        label="tolerance of a good model",
    )
    ax.axvline(null, color=FLOOR, lw=1.5, label="your model")
    ax.plot([low, high], [0.0, 0.0], color=AFTER, lw=4, solid_capstyle="butt")
    ax.plot(value, 0.0, "o", color=AFTER, ms=7, label="estimate with 95 % interval")
    ends = (null - tolerance, null + tolerance, low, high, value)
    margin = 0.08 * (max(ends) - min(ends)) + 1e-12
    ax.set_xlim(min(ends) - margin, max(ends) + margin)
    ax.set_ylim(-1.0, 1.0)
    ax.spines["left"].set_visible(False)
    ax.set_xlabel(f"[{unit}]" if unit else "", fontsize=8, loc="right")
