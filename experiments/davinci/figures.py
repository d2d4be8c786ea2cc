"""Pictures of the da Vinci cable drive: what is measured, and what structures make of it."""

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

MEASURED, MODEL, RIVAL = "#222222", "#D55E00", "#0072B2"
MOVING = 0.05
"""The spindle surely moves above this [rad/s]."""
MIDDLE = 0.2
"""Sliding is looked at this close to the middle of the spindle's way [rad]."""


def pictures(runs: Runs, best: Fitted, scores: Mapping[str, Scores]) -> list[Picture]:
    """All pictures of the report."""
    found = [
        Picture(
            "Torque of the spindle and angle of the jaw, over the angle of the spindle",
            _loops(runs, best),
            "At the second lowest frequency, four loads. Black: measured; orange: the whole "
            "structure, from spindle angle and load alone. The width of the loops is friction, and "
            "grows with the load; the angle lags by the cable's stretch. Below: the same at the "
            "highest frequency.",
        ),
        Picture(
            "Sliding: torque over load, and over frequency",
            _sliding(runs),
            "Medians in the middle of the way, one point a run. Left: closing needs more than the "
            "load, opening less, both along straight lines. Right: half the difference of closing "
            "and opening hardly depends on the frequency, over which velocity grows fivefold.",
        ),
        Picture(
            "After the spindle turns round",
            _reversals(runs, best),
            "Torque since the spindle turned back from its closed end, at the second lowest "
            "frequency. First it falls while the spindle has hardly moved: friction before the "
            "cable. Then it falls along the cable's stiffness until the cable slides.",
        ),
        Picture(
            "How far the cable is stretched, over its torque",
            _stretch(runs, best),
            "Spindle angle less jaw angle over the ratio, less the jaw's compliance; over the "
            "spindle's torque less bearing, spring and offset. The line is the fitted law.",
        ),
        Picture(
            "Errors on loads and frequencies that were held out",
            _errors(scores),
            "RMS over what was held out, one dot a load (ten) or frequency (five); orange: each "
            "structure has one thing more than the one above; blue: the whole, changed.",
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
    """Median load (2, r) and torque (2, r) [N m] in the middle of the way, closing and opening."""
    velocity = np.gradient(runs.drive, runs.time, axis=0)
    near = runs.use & (np.abs(runs.drive - np.median(runs.drive)) < MIDDLE)
    load, torque = np.full((2, len(runs.load)), np.nan), np.full((2, len(runs.load)), np.nan)
    for way, moves in enumerate((velocity > MOVING, velocity < -MOVING)):
        for run in range(len(runs.load)):
            at: NDArray[np.bool_] = near[:, run] & moves[:, run]
            if np.any(at):
                load[way, run] = np.median(runs.resistance[at, run])
                torque[way, run] = np.median(runs.torque[at, run])
    return load, torque


def _sliding(runs: Runs) -> bytes:
    load, torque = sliding(runs)
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(12, 4.6), layout="constrained")
    for way, (colour, name) in enumerate(((MODEL, "closing"), (RIVAL, "opening"))):
        left.plot(load[way], torque[way], "o", ms=4, color=colour)
        good = np.isfinite(load[way])
        slope, start = np.polyfit(load[way][good], torque[way][good], 1)
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
    right.set_ylabel("half the loop's width [N m]")
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
    axis.set_xlabel("angle of the spindle since it turned round [rad]")
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
    axis.set_ylabel("stretch of the cable, as spindle angle [rad]")
    return png(figure)


def predict_without_cable(best: Fitted, runs: Runs) -> Floats:
    """Torque of bearing, spring and offset (n, r) [N m]: all but the cable."""
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
        colour = RIVAL if score.fitted_candidate else MODEL
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
