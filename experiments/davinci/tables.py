"""Tables of the da Vinci cable drive: hold-out errors, parameters, established claims."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from experiments.davinci.fit import JAW_SCALE, TORQUE_SCALE, Errors, Fitted
from experiments.davinci.models import ABLATIONS, UNITS, Structure
from experiments.harness.report import Table
from jmm_agent.types import Floats

WHOLE_NAME = "whole"

SPEED = 1.6
"""Largest speed of the spindle, at the highest frequency [rad/s]."""

FINE_RATE = 100.0
"""Rate of the samples for a fit with a wider band [Hz]."""

CLEAR = 0.03
"""Relative difference of hold-out errors below which structures count as equal."""


@dataclass(frozen=True)
class Scores:
    """Errors of a structure.

    Attributes:
        structure: that was fitted.
        all: errors on all runs, fitted to all.
        loads, frequencies: errors on each load and frequency, fitted to all others.
        alternative: whether the structure is compared with the whole, and not part of the ladder.
    """

    structure: Structure
    all: Errors
    loads: dict[float, Errors]
    frequencies: dict[float, Errors]
    alternative: bool


def misfit(errors: Errors) -> float:
    """RMS errors of torque and angle combined, each relative to that of the best structures [1]."""
    return float(np.hypot(errors.torque / TORQUE_SCALE, errors.jaw / JAW_SCALE))


def wins(one: Mapping[float, Errors], other: Mapping[float, Errors]) -> tuple[int, int]:
    """Number of groups on which one is better than the other by `CLEAR`, and worse."""
    ratios = [misfit(one[key]) / misfit(other[key]) for key in one]
    return sum(r < 1 - CLEAR for r in ratios), sum(r > 1 + CLEAR for r in ratios)


def ladder_table(scores: Mapping[str, Scores]) -> Table:
    """Errors of all structures."""
    head = ("structure", "p", "torque: all", "loads", "freq.", "jaw: all", "loads", "freq.")
    rows: list[tuple[object, ...]] = []
    for score in scores.values():
        cells: list[object] = [score.structure.title, len(score.structure.parameters)]
        for what in ("torque", "jaw"):
            groups = (score.loads, score.frequencies)
            cells.append(f"{1e3 * getattr(score.all, what):.1f}")
            cells += [f"{_mean(group, what):.1f} ({_worst(group, what):.1f})" for group in groups]
        rows.append(tuple(cells))
    note = (
        "RMS errors of the spindle's torque [mN m] and the jaw's angle [mrad]: fitted to all "
        "runs; and on loads and frequencies that are held out one at a time: mean (worst). p: "
        "number of parameters. Those with + have one element more than the structure above."
    )
    return Table("Structures and their errors", head, rows, note)


def _mean(groups: Mapping[float, Errors], what: str) -> float:
    return 1e3 * float(np.sqrt(np.mean([getattr(e, what) ** 2 for e in groups.values()])))


def _worst(groups: Mapping[float, Errors], what: str) -> float:
    return 1e3 * max(float(getattr(e, what)) for e in groups.values())


def parameter_table(best: Fitted, widths: Floats) -> Table:
    """Parameters of the last structure of the ladder, with intervals."""
    rows = [
        (name, f"{value:.4g}", f"{value - width:.4g} to {value + width:.4g}", UNITS[name])
        for name, value, width in zip(best.structure.parameters, best.values, widths, strict=True)
    ]
    note = (
        "Intervals of 95 %, from the scatter between runs. They hold within this structure; "
        "between structures that fit equally well, parameters differ by more."
    )
    head = ("", "value", "95 % interval", "unit")
    return Table("Parameters of the whole", head, rows, note)


def evidence_table(scores: Mapping[str, Scores]) -> Table:
    """Effect of each part of the structure on hold-out errors."""
    rows = [
        claim(scores, "Coulomb friction", "coulomb", "rigid"),
        *(claim(scores, title, WHOLE_NAME, title) for title in ABLATIONS),
        claim(scores, "viscous friction", "viscous", WHOLE_NAME),
        claim(scores, "a cable that hardens instead of backlash", WHOLE_NAME, "backlash"),
        claim(scores, "the capstan law instead of proportionality", WHOLE_NAME, "linear"),
    ]
    note = (
        "Each claim compares two structures on every load and frequency that is held out: the "
        f"number on which the first is better by {100 * CLEAR:.0f} %, and worse. Established: "
        "better on all frequencies and on all loads except at most one."
    )
    head = ("claim", "compared with", "loads: better, worse", "frequencies", "established")
    return Table("What is established", head, rows, note)


def claim(
    scores: Mapping[str, Scores], title: str, name: str, other: str
) -> tuple[str, str, str, str, str]:
    """One row of the table of evidence."""
    one, two = scores[name], scores[other]
    loads = wins(one.loads, two.loads)
    frequencies = wins(one.frequencies, two.frequencies)
    sure = loads[0] >= len(one.loads) - 1 and frequencies[0] == len(one.frequencies)
    return (
        title,
        two.structure.title.removeprefix("+ "),
        f"{loads[0]}, {loads[1]} of {len(one.loads)}",
        f"{frequencies[0]}, {frequencies[1]} of {len(one.frequencies)}",
        "yes" if sure else "no",
    )


def open_table(
    scores: Mapping[str, Scores],
    fitted: Mapping[str, Fitted],
    widths: Mapping[str, Floats],
    finer: Fitted,
) -> Table:
    """Properties that these data do not determine, with the reason.

    Args:
        scores: errors of every structure.
        fitted: every structure, fitted to all runs.
        widths: half widths of the intervals of its parameters.
        finer: the whole, fitted to the same runs with a wider band.
    """
    rows = [
        _friction_row(fitted, widths),
        _viscous_row(fitted, widths),
        (
            "location of the second compliance",
            "It depends on the load alone: the jaw's end of a cable with friction along its whole "
            "path, the jaw, or the fixture that holds it.",
        ),
        _hardening_row(scores),
        (
            "spring and offset",
            "An offset of the torque sensor and another rest angle of the spring are equivalent.",
        ),
        _bearing_row(fitted[WHOLE_NAME], finer),
        ("inertia", "Too small to be observed in motions as slow as these."),
    ]
    return Table("What is not established", ("", "reason"), rows)


def _friction_row(fitted: Mapping[str, Fitted], widths: Mapping[str, Floats]) -> tuple[str, str]:
    whole = fitted[WHOLE_NAME]
    angles = _value(whole, "kinematic_gear")
    off = [_value(found, "gear") / angles - 1 for found in (whole, fitted["linear"])]
    return (
        "whether friction follows the capstan law or is proportional to the load",
        "Both predict the same torques. They differ in the ratio of torques: "
        f"{_range(fitted, widths, WHOLE_NAME, 'gear')} with the capstan law, "
        f"{_range(fitted, widths, 'linear', 'gear')} with proportional friction. Without other "
        f"losses it equals that of angles, {_range(fitted, widths, WHOLE_NAME, 'kinematic_gear')}: "
        f"it deviates by {100 * off[0]:+.0f} % and {100 * off[1]:+.0f} %, which is plausible for a "
        "torque sensor.",
    )


def _viscous_row(fitted: Mapping[str, Fitted], widths: Mapping[str, Floats]) -> tuple[str, str]:
    most = _bound(fitted, widths, "viscous", "viscous")
    return (
        "viscous friction",
        f"At most {most:.4f} N m s/rad: {1e3 * most * SPEED:.1f} mN m at {SPEED} rad/s, the "
        "highest speed.",
    )


def _hardening_row(scores: Mapping[str, Scores]) -> tuple[str, str]:
    hard, gap = (scores[name].loads for name in (WHOLE_NAME, "backlash"))
    better, worse = wins(hard, gap)
    return (
        "whether the cable hardens or has backlash",
        f"One of them is necessary. Of {len(hard)} loads held out, hardening is better on {better} "
        f"and worse on {worse}; its worst error of the jaw is {_worst(hard, 'jaw'):.1f} mrad, "
        f"that of backlash {_worst(gap, 'jaw'):.1f}.",
    )


def _bearing_row(whole: Fitted, finer: Fitted) -> tuple[str, str]:
    stiffness = [_value(found, "drive_stiffness") for found in (whole, finer)]
    return (
        "whether the spindle's bearing is elastic before it slips",
        f"Its stiffness is {stiffness[0]:.0f} N m/rad here and {stiffness[1]:.0f} in samples of "
        f"{FINE_RATE:g} Hz. It is limited by the sampling, so this is a lower bound.",
    )


def _value(found: Fitted, parameter: str) -> float:
    return float(found.values[found.structure.parameters.index(parameter)])


def _bound(
    fitted: Mapping[str, Fitted], widths: Mapping[str, Floats], name: str, parameter: str
) -> float:
    at = fitted[name].structure.parameters.index(parameter)
    return float(abs(fitted[name].values[at]) + widths[name][at])


def _range(
    fitted: Mapping[str, Fitted], widths: Mapping[str, Floats], name: str, parameter: str
) -> str:
    at = fitted[name].structure.parameters.index(parameter)
    value, width = fitted[name].values[at], widths[name][at]
    return f"{value - width:.3f} to {value + width:.3f}"
