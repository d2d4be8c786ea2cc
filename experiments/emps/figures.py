"""Figures of the EMPS diagnosis: force, remainder and parameters."""

from __future__ import annotations

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes

from experiments.emps.log import MASS, PUBLISHED, Log, at_readings, motion
from experiments.emps.regression import UNITS, Regression
from experiments.harness.report import Picture, png
from jmm_agent.types import Floats
from reality_gap.diagnosis import Diagnosis, Trace
from reality_gap.study.data import Study

MEASURED, ALONE, TEXTBOOK, DIRECTION = "#222222", "#999999", "#D55E00", "#0072B2"


def pictures(
    log: Log,
    study: Study,
    first: Diagnosis,
    second: Diagnosis,
    fits: dict[str, Regression],
) -> list[Picture]:
    """All figures of the report."""
    found = [
        Picture(
            "Force of the drive, and remainder of each model",
            _force_figure(log, first.traces[0], second.traces[0]),
            "First 7 s. Position of the carriage; measured force and that of the mass alone; "
            "remainder after textbook causes (friction and offset) and after all causes.",
        ),
        Picture(
            "Remainder over velocity and position",
            _remainder_figure(study, first.traces[0], second.traces[0]),
            "At constant velocity. Left: medians and quartiles at each such velocity. After "
            "textbook causes they differ from zero, and between directions; direction-dependent "
            "friction explains most of this. Right: the remainder is mostly a repeatable ripple "
            "over the position, for which there is no cause in the catalogue.",
        ),
        Picture(
            "Parameters and their 95 % intervals, relative to the published ones",
            _parameter_figure(first, fits["as published"]),
            "1 is the published value. Circles: the diagnosis; squares: least squares.",
        ),
    ]
    pyplot.close("all")
    return found


def _force_figure(log: Log, first: Trace, second: Trace) -> bytes:
    figure, axes = pyplot.subplots(
        4, 1, figsize=(11, 10), sharex=True, layout="constrained", height_ratios=(1, 1.6, 1, 1)
    )
    axes[0].plot(log.time, log.position, color=MEASURED, lw=1)
    axes[0].set_ylabel("position [m]")
    axes[1].plot(first.time, first.before, color=ALONE, lw=1, label="mass alone")
    axes[1].plot(first.time, first.measured, color=MEASURED, lw=1, label="measured")
    axes[1].set_ylabel("force [N]")
    axes[1].legend(loc="upper right", ncols=2)
    for axis, trace, colour, name in (
        (axes[2], first, TEXTBOOK, "after textbook causes"),
        (axes[3], second, DIRECTION, "after all causes"),
    ):
        axis.axhline(0.0, color="#cccccc", lw=1)
        axis.plot(trace.time, trace.measured - trace.after, color=colour, lw=1)
        axis.set_ylabel("remainder [N]")
        axis.set_title(name, fontsize=10, loc="left")
        axis.set_ylim(-10, 10)
    axes[3].set_xlim(0.0, min(7.0, float(log.time[-1])))
    axes[3].set_xlabel("time [s]")
    return png(figure)


def _remainder_figure(study: Study, first: Trace, second: Trace) -> bytes:
    along = motion(study)
    velocity = at_readings(study, along.qvel[:, 0])
    position = at_readings(study, along.qpos[:, 0])
    even = np.abs(at_readings(study, along.qacc[:, 0])) < 0.05
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(12, 4.6), layout="constrained")
    for trace, colour, name in (
        (first, TEXTBOOK, "after textbook causes"),
        (second, DIRECTION, "after all causes"),
    ):
        remainder = trace.measured - trace.after
        _medians(left, velocity[even], remainder[even], colour, name)
        right.plot(position[even], remainder[even], ".", ms=2, color=colour, label=name)
    for axis, what in ((left, "velocity [m/s]"), (right, "position [m]")):
        axis.axhline(0.0, color="#cccccc", lw=1, zorder=0)
        axis.set_xlabel(what)
        axis.set_ylabel("measured - computed force [N]")
        axis.legend()
    return png(figure)


def _medians(axis: Axes, velocity: Floats, remainder: Floats, colour: str, name: str) -> None:
    """Median and quartiles at each constant velocity of the carriage."""
    speeds = np.round(velocity, 2)
    held = [speed for speed in np.unique(speeds) if np.sum(speeds == speed) > 20]
    quartiles = np.array([np.quantile(remainder[speeds == v], (0.25, 0.5, 0.75)) for v in held])
    if not held:
        return
    low, middle, high = quartiles.T
    axis.errorbar(
        held,
        middle,
        yerr=(middle - low, high - middle),
        fmt="o-",
        color=colour,
        label=name,
        capsize=3,
    )


def _parameter_figure(first: Diagnosis, fit: Regression) -> bytes:
    named = {
        cause.candidate.cause.id: next(iter(cause.parameters.values())) for cause in first.causes
    }
    rows = (
        ("mass", "", MASS, 1.0),
        ("viscous", "viscous_friction", PUBLISHED["viscous"], 1.0),
        ("coulomb", "coulomb_friction", PUBLISHED["coulomb"], 1.0),
        ("offset", "force_offset", PUBLISHED["offset"], -1.0),
    )
    figure, axis = pyplot.subplots(figsize=(8, 3.4), layout="constrained")
    axis.axvline(1.0, color=ALONE, lw=1)
    for number, (name, cause, known, sign) in enumerate(rows):
        value, width = fit.values[name] / known, fit.widths[name] / abs(known)
        axis.errorbar(value, number + 0.12, xerr=width, fmt="s", color=MEASURED, capsize=3)
        if cause in named:
            e = named[cause]
            low, high = sorted((sign * e.low / known, sign * e.high / known))
            middle = sign * e.value / known
            error = [[middle - low], [high - middle]]
            axis.errorbar(middle, number - 0.12, xerr=error, fmt="o", color=TEXTBOOK, capsize=3)
    axis.set_yticks(range(len(rows)), [f"{row[0]} ({UNITS[row[0]]})" for row in rows])
    axis.invert_yaxis()
    axis.set_xlabel("value relative to the published one [1]")
    return png(figure)
