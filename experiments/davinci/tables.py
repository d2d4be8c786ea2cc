"""Tables of the da Vinci cable drive: errors held out, parameters, and what is established."""

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
"""Of the spindle at the highest frequency [rad/s]."""

FINE_RATE = 100.0
"""Of samples that show what the usual band hides [Hz]."""

CLEAR = 0.03
"""A held-out error that differs by less than this share differs by nothing."""


@dataclass(frozen=True)
class Scores:
    """A structure's errors: on all runs, and on each load and frequency when it is held out."""

    structure: Structure
    all: Errors
    loads: dict[float, Errors]
    frequencies: dict[float, Errors]
    fitted_candidate: bool


def misfit(errors: Errors) -> float:
    """Torque and angle together, each over what the best structures leave [1]."""
    return float(np.hypot(errors.torque / TORQUE_SCALE, errors.jaw / JAW_SCALE))


def wins(one: Mapping[float, Errors], other: Mapping[float, Errors]) -> tuple[int, int]:
    """On how many groups one is clearly better than the other, and clearly worse."""
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
        "RMS errors of the spindle's torque [mN m] and the jaw's angle [mrad]: fitted to all runs; "
        "and on loads and on frequencies that were held out, one at a time: mean (worst). p: how "
        "many parameters. Those with + have one thing more than the one above."
    )
    return Table("Structures and their errors", head, rows, note)


def _mean(groups: Mapping[float, Errors], what: str) -> float:
    return 1e3 * float(np.sqrt(np.mean([getattr(e, what) ** 2 for e in groups.values()])))


def _worst(groups: Mapping[float, Errors], what: str) -> float:
    return 1e3 * max(float(getattr(e, what)) for e in groups.values())


def parameter_table(best: Fitted, widths: Floats) -> Table:
    """Values of the last of the ladder with intervals."""
    rows = [
        (name, f"{value:.4g}", f"{value - width:.4g} to {value + width:.4g}", UNITS[name])
        for name, value, width in zip(best.structure.parameters, best.values, widths, strict=True)
    ]
    note = (
        "Intervals of 95 %, from the scatter between runs. They hold within this structure; in "
        "others that fit alike, parameters differ by more."
    )
    head = ("", "value", "95 % interval", "unit")
    return Table("Parameters of the whole", head, rows, note)


def evidence_table(scores: Mapping[str, Scores]) -> Table:
    """What each part of the structure brings on what was held out."""
    rows = [
        claim(scores, "Coulomb friction", "coulomb", "rigid"),
        *(claim(scores, title, WHOLE_NAME, title) for title in ABLATIONS),
        claim(scores, "viscous friction", "viscous", WHOLE_NAME),
        claim(scores, "a cable that hardens, not backlash", WHOLE_NAME, "backlash"),
        claim(scores, "capstan's law, not proportion", WHOLE_NAME, "linear"),
    ]
    note = (
        "Each claim compares two structures on every load and frequency that was held out: on how "
        f"many the first is better by {100 * CLEAR:.0f} %, and worse. Established: better on all "
        "frequencies and on all loads but one at most."
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
    """What these data do not establish, and why.

    Args:
        scores, fitted: every structure.
        widths: half widths of its intervals.
        finer: the whole, fitted to the same runs with a wider band.
    """
    whole = fitted[WHOLE_NAME]
    most = _bound(fitted, widths, "viscous", "viscous")
    angles = _value(whole, "kinematic_gear")
    off = [_value(found, "gear") / angles - 1 for found in (whole, fitted["linear"])]
    hard, gap = (scores[name].loads for name in (WHOLE_NAME, "backlash"))
    better, worse = wins(hard, gap)
    stiffness = [_value(found, "drive_stiffness") for found in (whole, finer)]
    rows = [
        (
            "whether friction follows capstan's law or is in proportion to the load",
            "Both make the same torques. They differ in the ratio of torques: "
            f"{_range(fitted, widths, WHOLE_NAME, 'gear')} by capstan, "
            f"{_range(fitted, widths, 'linear', 'gear')} in proportion. Without other losses it is "
            f"that of angles, {_range(fitted, widths, WHOLE_NAME, 'kinematic_gear')}: off by "
            f"{100 * off[0]:+.0f} % and {100 * off[1]:+.0f} %, as a torque sensor may be.",
        ),
        (
            "viscous friction",
            f"At most {most:.4f} N m s/rad: {1e3 * most * SPEED:.1f} mN m at {SPEED} rad/s, the "
            "highest speed.",
        ),
        (
            "where the second compliance is",
            "It gives under the load alone: the jaw's end of a cable that rubs all along its way, "
            "the jaw, or the bench that holds it.",
        ),
        (
            "whether the cable hardens or has play",
            f"One of them is needed. Of {len(hard)} loads held out, hardening wins {better} and "
            f"loses {worse}; its worst error of the jaw is {_worst(hard, 'jaw'):.1f} mrad, "
            f"that of play {_worst(gap, 'jaw'):.1f}.",
        ),
        (
            "what the spring and the offset are",
            "An offset of the torque sensor and another rest of the spring are the same.",
        ),
        (
            "whether the spindle's bearing gives before it slips",
            f"Its stiffness is {stiffness[0]:.0f} N m/rad here, {stiffness[1]:.0f} in samples of "
            f"{FINE_RATE:g} Hz: that is what sampling lets through, a lower bound.",
        ),
        ("inertia", "Too small to show in motions this slow."),
    ]
    return Table("What is not established", ("", "why"), rows)


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
