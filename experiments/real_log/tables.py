"""Tables and metrics of the log of a measured robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.harness.report import Table
from experiments.harness.statistics import metric
from experiments.real_log.baselines import METHODS
from experiments.real_log.machine import NAMES, TO_UNITS, UNITS
from experiments.real_log.trial import OWN, TITLES
from jmm_agent.types import Floats

SHEET = "data sheet"
INSTRUMENT = ("roll", "wrist pitch", "wrist yaw")
"""Joints that cables through the instrument move; those of the arm are at their floor from the
first samples on."""
COVERED = 0.9
"""Least share of errors inside of the predicted 95 % [1]."""
Trials = Sequence[Mapping[str, Any]]


def whole(title: str) -> str:
    """Title of a method outside of a table."""
    return title.replace("...", "ours,")


def joint_errors(trials: Trials, title: str, count: int) -> Floats:
    """RMS errors (S, 6) [deg, mm] of a method, from each start."""
    return np.array([one["errors"][title][str(count)] for one in trials]) * TO_UNITS


def shares(trials: Trials, title: str, count: int) -> Floats:
    """Error as a share of the data sheet's, geometric mean over joints, from each start (S,)."""
    ratio = joint_errors(trials, title, count) / joint_errors(trials, SHEET, count)
    return np.exp(np.log(ratio).mean(axis=1))


def least_errors(floor: Mapping[str, Any]) -> Floats:
    """The floor of each joint (6,) [deg, mm]; NaN without pairs."""
    return np.array([joint["floor"] for joint in floor["joints"]], dtype=float) * TO_UNITS


def floor_share(trials: Trials, floor: Mapping[str, Any], count: int) -> float:
    """The floor as a share of the data sheet's error, as `shares`; NaN without pairs."""
    ratio = least_errors(floor) / joint_errors(trials, SHEET, count)[0]
    return float(np.exp(np.log(ratio).mean()))


def metrics(trials: Trials, floor: Mapping[str, Any], counts: Sequence[int]) -> dict[str, Any]:
    """Metrics over the starts: our errors beside those of the data sheet and the best baseline."""
    found = {}
    for count in counts:
        others = np.min([shares(trials, method, count) for method in METHODS], axis=0)
        for title in OWN:
            own, name = shares(trials, title, count), whole(title)
            found[f"{name}: share of the data sheet's error, {count}"] = metric(own, "")
            found[f"{name}: error over the best baseline's, {count}"] = metric(
                own / others, "", must=1.0
            )
    columns = [NAMES.index(name) for name in INSTRUMENT]
    for title in OWN:
        covered = [float(np.mean(np.array(one["covered"][title])[columns])) for one in trials]
        found[f"{whole(title)}: instrument's errors inside of the predicted 95 %"] = metric(
            covered, "", must=COVERED, good="high"
        )
    least = floor_share(trials, floor, counts[-1])
    if np.isfinite(least):
        found["floor: share of the data sheet's error"] = metric([least], "")
    return found


def error_table(trials: Trials, floor: Mapping[str, Any], count: int) -> Table:
    """Errors of each joint with the most samples, ``count``."""
    head = ("method", *(f"{n} [{u}]" for n, u in zip(NAMES, UNITS, strict=True)))
    rows = []
    for title in TITLES:
        found = joint_errors(trials, title, count)
        rows.append((title, *(_cell(column, title != SHEET) for column in found.T)))
    rows.append(("floor of any map", *(f"{one:.3g}" for one in least_errors(floor))))
    note = (
        f"RMS on the second half of the log; median over {len(trials)} starts in the first half "
        "(worst). Floor: spread of the joint angle among samples with the same motor angles."
    )
    return Table(f"Errors after {count} samples", head, rows, note)


def progress_table(trials: Trials, floor: Mapping[str, Any], counts: Sequence[int]) -> Table:
    """Errors of the instrument's joints by the number of samples."""
    rows = []
    for title in TITLES:
        found = [_instrument(joint_errors(trials, title, count)) for count in counts]
        rows.append((title, *(_cell(one, title != SHEET) for one in found)))
    least = _instrument(least_errors(floor)[None])[0]
    rows.append(("floor of any map", *([f"{least:.3g}"] * len(counts))))
    note = f"RMS over {', '.join(INSTRUMENT)} [deg]; median over starts (worst)."
    head = ("method", *(str(count) for count in counts))
    return Table("Errors by the number of samples", head, rows, note)


def direction_table(trials: Trials, floor: Mapping[str, Any]) -> Table:
    """How much of what is left depends on the direction of motion."""
    head = (
        "joint",
        "unit",
        "up - down",
        "best map",
        "half the play",
        "by last direction [%]",
        "by one play [%]",
        "by plays of all widths [%]",
        "left",
        "from one side",
    )
    rows = []
    for number, (name, unit, factor) in enumerate(zip(NAMES, UNITS, TO_UNITS, strict=True)):
        found = [one["direction"][number] for one in trials]
        gap = _median([floor["joints"][number]["gap"]]) * factor
        static, play, left, side = (
            _median([one[key] for one in found]) * factor
            for key in ("static", "play", "left", "one_side")
        )
        explained = [
            f"{100 * np.median([one[key] for one in found]):.0f}"
            for key in ("by_sign", "by_play", "by_plays")
        ]
        rows.append(
            (
                name,
                unit,
                _number(gap),
                _number(static),
                _number(play),
                *explained,
                f"{left:.3g}",
                f"{side:.3g}",
            )
        )
    note = (
        "Up - down: joint angle after a motion upwards minus that after one downwards, at the same "
        "motor angles. Best map: RMS that is left on the second half if our map is corrected by "
        "all of the first half. Shares of its square that the direction of motion explains beside "
        "it. Left: RMS with plays of all widths. From one side: RMS at postures that were "
        "approached from one side by more than the play."
    )
    return Table("Dependence on the direction of motion", head, rows, note)


def _number(value: float) -> str:
    """A number of a table; empty if it is unknown."""
    return "" if np.isnan(value) else f"{value:.3g}"


def _median(numbers: Sequence[float | None]) -> float:
    """Median of numbers, of which None are unknown; NaN if one is."""
    return float(np.median(np.array(numbers, dtype=float)))


def _instrument(errors: Floats) -> Floats:
    """RMS over the instrument's joints (S,) of errors (S, 6) [deg]."""
    columns = [NAMES.index(name) for name in INSTRUMENT]
    return np.sqrt(np.mean(errors[:, columns] ** 2, axis=1))


def _cell(errors: Floats, several: bool) -> str:
    """Median of errors (S,), and the largest if they are ``several`` different ones."""
    worst = f" ({errors.max():.3g})" if several else ""
    return f"{np.median(errors):.3g}{worst}"
