"""Figures of the da Vinci cable drive: measurements and predictions of structures."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from experiments.davinci.fit import Fitted
from experiments.davinci.log import Runs
from experiments.davinci.models import predict
from experiments.davinci.tables import Scores
from experiments.harness.report import Picture, png
from jmm_agent.types import Floats

MEASURED, MODEL, ALTERNATIVE = "#222222", "#D55E00", "#0072B2"
MOVING = 0.05
"""Speed above which the spindle counts as moving [rad/s]."""
MIDDLE = 0.2
"""Distance from the middle of the spindle's range within which sliding is evaluated [rad]."""


def pictures(runs: Runs, best: Fitted, scores: Mapping[str, Scores]) -> list[Picture]:
    """All figures of the report."""
    found = [
        Picture(
            "Torque of the spindle and angle of the jaw, over the angle of the spindle",
            _loops(runs, best),
            "Top: four loads at the second lowest frequency; bottom: the highest frequency. Black: "
            "measured; orange: predicted by the whole structure from spindle angle and load. The "
            "width of the loops is due to friction and grows with the load; the angle lags by the "
            "elongation of the cable.",
        ),
        Picture(
            "Sliding: torque over load, and over frequency",
            _sliding(runs),
            "Medians in the middle of the range, one point a run. Left: closing needs more torque "
            "than the load and opening less, both linear in the load. Right: half the difference "
            "of closing and opening hardly depends on the frequency, although velocity grows "
            "fivefold.",
        ),
        Picture(
            "After a reversal of the spindle",
            _reversals(runs, best),
            "Torque after the reversal at the closed end, at the second lowest frequency. It falls "
            "first while the spindle hardly moves, due to friction before the cable, then with the "
            "stiffness of the cable until the cable slides.",
        ),
        Picture(
            "Elongation of the cable over its torque",
            _stretch(runs, best),
            "Spindle angle minus jaw angle over the ratio, minus the jaw's compliance; over the "
            "spindle's torque minus bearing, spring and offset. Line: fitted law.",
        ),
        Picture(
            "Errors on loads and frequencies that are held out",
            _errors(scores),
            "RMS over the data held out, one marker a load (ten) or frequency (five). Orange: each "
            "structure has one element more than the one above; blue: changes of the whole.",
        ),
    ]
    pyplot.close("all")
    return found


def _loads(runs: Runs, frequency: float) -> list[int]:
    at = np.flatnonzero(runs.frequency == frequency)
    ordered = at[np.argsort(runs.load[at])]
    return [int(i) for i in ordered[np.linspace(0, len(ordered) - 1, 4).round().astype(int)]]


def _loops(runs: Runs, best: Fitted) -> bytes:
    torque, jaw = predict(best.structure, best.values, runs)
    frequencies = np.unique(runs.frequency)
    figure, axes = pyplot.subplots(2, 2, figsize=(12, 9), layout="constrained", sharex=True)
    shown = (frequencies[min(1, len(frequencies) - 1)], frequencies[-1])
    for row, frequency in zip(axes, shown, strict=True):
        for run in _loads(runs, float(frequency)):
            use = runs.use[:, run]
            x = runs.drive[use, run]
            for axis, measured, model in (
                (row[0], runs.torque, torque),
                (row[1], runs.jaw, jaw),
            ):
                axis.plot(x, measured[use, run], color=MEASURED, lw=1)
                axis.plot(x, model[use, run], color=MODEL, lw=1)
            row[0].text(x.max(), runs.torque[use, run].max(), f" {runs.load[run]:g} %", va="top")
        row[0].set_ylabel("torque of the spindle [N m]")
        row[1].set_ylabel("angle of the jaw [rad]")
        row[0].set_title(f"{frequency:g} Hz", loc="left", fontsize=10)
    for axis in axes[-1]:
        axis.set_xlabel("angle of the spindle, closing [rad]")
    return png(figure)


def sliding(runs: Runs) -> tuple[Floats, Floats]:
    """Median load and torque in the middle of the range, shape (2, r) each [N m].

    The rows are closing and opening.
    """
    velocity = np.gradient(runs.drive, runs.time, axis=0)
    near = runs.use & (np.abs(runs.drive - np.median(runs.drive)) < MIDDLE)
    load, torque = np.full((2, len(runs.load)), np.nan), np.full((2, len(runs.load)), np.nan)
    for direction, moves in enumerate((velocity > MOVING, velocity < -MOVING)):
        for run in range(len(runs.load)):
            at: NDArray[np.bool_] = near[:, run] & moves[:, run]
            if np.any(at):
                load[direction, run] = np.median(runs.resistance[at, run])
                torque[direction, run] = np.median(runs.torque[at, run])
    return load, torque


def _sliding(runs: Runs) -> bytes:
    load, torque = sliding(runs)
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(12, 4.6), layout="constrained")
    for direction, (colour, name) in enumerate(((MODEL, "closing"), (ALTERNATIVE, "opening"))):
        left.plot(load[direction], torque[direction], "o", ms=4, color=colour)
        good = np.isfinite(load[direction])
        slope, start = np.polyfit(load[direction][good], torque[direction][good], 1)
        ends = np.array([0.0, np.nanmax(load)])
        label = f"{name}: {start:.3f} N m + {slope:.2f} load"
        left.plot(ends, start + slope * ends, color=colour, lw=1, label=label)
    left.set_xlabel("torque of the load [N m]")
    left.set_ylabel("torque of the spindle [N m]")
    left.legend()
    half = 0.5 * (torque[0] - torque[1])
    loads = np.unique(runs.load)
    for load_, shade in zip(loads, np.linspace(0.15, 0.85, len(loads)), strict=True):
        at = runs.load == load_
        right.plot(runs.frequency[at], half[at], "o-", ms=3, lw=1, color=pyplot.cm.viridis(shade))
        right.text(runs.frequency[at][-1], half[at][-1], f"  {load_:g} %", fontsize=8, va="center")
    right.set_xlabel("frequency [Hz]")
    right.set_ylabel("half the width of the loop [N m]")
    right.set_ylim(0.0, None)
    right.margins(x=0.12)
    return png(figure)


def _reversals(runs: Runs, best: Fitted) -> bytes:
    torque, _ = predict(best.structure, best.values, runs)
    frequencies = np.unique(runs.frequency)
    figure, axis = pyplot.subplots(figsize=(9, 5), layout="constrained")
    for run in _loads(runs, float(frequencies[min(1, len(frequencies) - 1)])):
        use = np.flatnonzero(runs.use[:, run])
        top = use[np.argmax(runs.drive[use, run])]
        after = np.arange(top, min(len(runs.time), top + round(len(runs.time) / 8)))
        turned = runs.drive[top, run] - runs.drive[after, run]
        near = turned < 0.2
        axis.plot(turned[near], runs.torque[after[near], run], ".-", color=MEASURED, lw=1)
        axis.plot(turned[near], torque[after[near], run], color=MODEL, lw=1)
        axis.text(0.2, runs.torque[after[near][-1], run], f"  {runs.load[run]:g} %", va="center")
    axis.set_xlim(-0.005, 0.22)
    axis.set_xlabel("angle of the spindle since the reversal [rad]")
    axis.set_ylabel("torque of the spindle [N m]")
    return png(figure)


def _stretch(runs: Runs, best: Fitted) -> bytes:
    p = dict(zip(best.structure.parameters, best.values, strict=True))
    torque, _ = predict(best.structure, best.values, runs)
    without = predict_without_cable(best, runs)
    slid = runs.jaw - p["jaw_offset"] + p["jaw_compliance"] * runs.resistance
    slid /= p["kinematic_gear"]
    figure, axis = pyplot.subplots(figsize=(9, 5), layout="constrained")
    shown = axis.scatter(
        (runs.torque - without)[runs.use],
        (runs.drive - slid)[runs.use],
        c=np.broadcast_to(runs.load, torque.shape)[runs.use],
        s=2,
        cmap="viridis",
        rasterized=True,
    )
    figure.colorbar(shown, label="load [%]")
    cable = (torque - without)[runs.use]
    ends = np.linspace(cable.min(), cable.max(), 200)
    k, hard = p["cable_stiffness"], p["hardening"]
    law = np.sign(ends) * (np.sqrt(k**2 + 4 * hard * np.abs(ends)) - k) / (2 * hard)
    axis.plot(ends, law, color=MODEL, lw=2)
    axis.set_xlabel("torque of the cable at the spindle [N m]")
    axis.set_ylabel("elongation of the cable, as spindle angle [rad]")
    return png(figure)


def predict_without_cable(best: Fitted, runs: Runs) -> Floats:
    """Torque of bearing, spring and offset without the cable, shape (n, r) [N m]."""
    slack = Runs(
        runs.time,
        runs.frequency,
        runs.load,
        runs.drive,
        0 * runs.torque,
        runs.jaw,
        0 * runs.resistance,
        runs.use,
    )
    p = dict(zip(best.structure.parameters, best.values, strict=True))
    p |= {"coulomb": p["drive_share"] * p["coulomb"], "drive_share": 1.0}
    alone = [p[name] for name in best.structure.parameters]
    return predict(best.structure, np.array(alone), slack)[0]


def _errors(scores: Mapping[str, Scores]) -> bytes:
    figure, axes = pyplot.subplots(1, 2, figsize=(13, 8), layout="constrained", sharey=True)
    for axis, what, unit, factor in (
        (axes[0], "torque", "torque of the spindle [mN m]", 1e3),
        (axes[1], "jaw", "angle of the jaw [mrad]", 1e3),
    ):
        _error_rows(axis, scores, what, factor)
        axis.set_xscale("log")
        axis.set_xticks((5, 10, 20, 50), ("5", "10", "20", "50"))
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.set_xlabel(f"RMS error, {unit}")
        axis.grid(axis="x", which="both", color="#eeeeee")
    axes[0].set_yticks(range(len(scores)), [score.structure.title for score in scores.values()])
    axes[0].invert_yaxis()
    axes[1].legend(loc="lower right")
    return png(figure)


def _error_rows(axis: Axes, scores: Mapping[str, Scores], what: str, factor: float) -> None:
    for number, score in enumerate(scores.values()):
        colour = ALTERNATIVE if score.alternative else MODEL
        for shift, marker, groups, name in (
            (-0.15, "o", score.loads, "loads held out"),
            (0.15, "^", score.frequencies, "frequencies held out"),
        ):
            found = [factor * getattr(errors, what) for errors in groups.values()]
            axis.plot(
                found,
                np.full(len(found), number + shift),
                marker,
                ms=4,
                color=colour,
                alpha=0.7,
                label=None if number else name,
            )
