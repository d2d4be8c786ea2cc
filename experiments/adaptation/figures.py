"""Figures of the adaptation: errors over postures, before and after the elongation."""

from __future__ import annotations

from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes

from experiments.adaptation.sizes import BEFORE, EVENT, OFF, Sizes
from experiments.harness.experiment import Results
from experiments.harness.report import Picture, png
from experiments.robots.conditions import ACTUAL, NOMINAL
from jmm_agent.types import Floats
from kengoro.visits import Visits, hand_mm, rmse_deg

ON_COLOUR, OFF_COLOUR = "#0072B2", "#D55E00"
UNITS = {"deg": "RMSE_joint [deg]", "mm": "Distance_hand [mm]"}


def pictures(results: Results, sizes: Sizes) -> list[Picture]:
    """Errors of the actual robots by both definitions, and of those without departures."""
    return [
        _picture(results, sizes, ACTUAL, "target_true", "target - true, actual robots"),
        _picture(results, sizes, ACTUAL, "estimate_seen", "estimate - seen, actual robots"),
        _picture(results, sizes, NOMINAL, "target_true", "target - true, no departures"),
    ]


def _picture(results: Results, sizes: Sizes, condition: str, pair: str, title: str) -> Picture:
    figure, axes = pyplot.subplots(1, len(UNITS), figsize=(11, 4))
    for ax, unit in zip(axes, UNITS, strict=True):
        _draw(ax, [result[condition] for result in results.values()], sizes, pair, unit)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", ncols=len(labels), fontsize=9)
    figure.tight_layout(rect=(0, 0, 1, 0.92))
    image = png(figure)
    pyplot.close(figure)
    return Picture(
        f"Error over visited postures, {title}",
        image,
        "Lines: error at each posture before the agent learns from it, median over robots; bands: "
        "quartiles. Circles: tests on postures that are never learned from, medians. The muscles "
        "elongate at the dashed line.",
    )


def _draw(axes: Axes, robots: list[dict[str, Any]], sizes: Sizes, pair: str, unit: str) -> None:
    first = np.arange(1, sizes.learned + 1)
    later = sizes.learned + np.arange(1, sizes.more + 1)
    for name, x, colour, label in (
        ("learned", first, ON_COLOUR, "learning on"),
        ("off", later, OFF_COLOUR, "learning off"),
        ("on", later, ON_COLOUR, None),
    ):
        curves = np.array([_curve(robot["visits"][name], pair, unit) for robot in robots])
        masked = np.ma.masked_invalid(curves)
        low, high = (_quantile(masked, share) for share in (0.25, 0.75))
        axes.plot(x, np.ma.median(masked, axis=0), color=colour, label=label)
        axes.fill_between(x, low, high, color=colour, alpha=0.2, lw=0)
    event = sizes.learned + 0.5
    on = {BEFORE: event - 0.5, **{str(n): sizes.learned + n for n in sizes.checks}}
    off = {EVENT: event + 0.5, OFF: sizes.learned + sizes.more}
    for marks, colour, label in (
        (on, ON_COLOUR, "test, learning on"),
        (off, OFF_COLOUR, "test, learning off"),
    ):
        heights = [_test(robots, name, pair, unit) for name in marks]
        axes.plot([*marks.values()], heights, "o", color=colour, mec="white", ms=8, label=label)
    axes.axvline(event, color="black", ls="--", lw=1, label="elongation of muscles")
    axes.set_ylim(bottom=0)
    axes.set_xlabel("number of postures visited")
    axes.set_ylabel(UNITS[unit])


def _curve(visits: Visits, pair: str, unit: str) -> Floats:
    """Error of each visit; NaN where it needs an observation of the hand and there is none."""
    one, other = pair.split("_")
    there = [
        a is not None and b is not None for a, b in zip(visits[one], visits[other], strict=True)
    ]
    curve = np.full(len(there), np.nan)
    curve[there] = rmse_deg(visits, pair) if unit == "deg" else hand_mm(visits, pair)
    return curve


def _quantile(masked: np.ma.MaskedArray, share: float) -> Floats:
    """Quantile over the robots that are not masked, at each posture; NaN where all are masked."""
    columns = [column.compressed() for column in masked.T]
    return np.array([np.quantile(c, share) if c.size else np.nan for c in columns])


def _test(robots: list[dict[str, Any]], name: str, pair: str, unit: str) -> float:
    """Median over robots of the median error in a test; NaN if the hand was never seen."""
    curves = [_curve(robot["tests"][name], pair, unit) for robot in robots]
    medians = [np.nanmedian(curve) for curve in curves if np.isfinite(curve).any()]
    return float(np.median(medians)) if medians else np.nan
