"""Column errors: readings that follow the model's replay with a wrong sign, unit or column.

A replay of the nominal model moves much like the machine. A reading that
follows it with the opposite sign, or with a slope of 180/pi or 1000, or that follows the replay of
another sensor, is one that was assigned or converted wrongly.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import linear_sum_assignment

from reality_gap.study.data import Study
from reality_gap.study.measurements import Measured
from reality_gap.types import Bools, Floats, Ints

FOLLOWS = 0.95
"""Correlation with a replay from which on a reading follows it."""
OPPOSES = 0.8
"""The same for the opposite sign, which few faults cause."""
STRAYS = 0.7
"""Correlation with the replay of its own sensor below which a reading may belong to another."""
CLOSE = 0.2
"""Largest difference of a slope from a factor between units, relative to the factor."""
MOVES = 3.0
"""Standard deviation of a reading and of its replay from which on they are compared [noise]."""
UNITS = {
    180.0 / np.pi: "is in degrees, but read as radians",
    np.pi / 180.0: "is in radians, but read as degrees",
    1000.0: "is in thousandths of the unit that is stated",
    0.001: "is in thousands of the unit that is stated",
}
"""Factors between units, and what a slope of that size means."""


@dataclass(frozen=True)
class ColumnError:
    """A channel that was assigned or converted wrongly.

    Attributes:
        kind: what is wrong.
        channel: index of the channel.
        sentence: what is wrong, with advice.
        factor: factor by which readings are to be multiplied.
        other: index of the channel whose readings belong here, if ``kind`` is "column".
    """

    kind: Literal["sign", "unit", "column"]
    channel: int
    sentence: str
    factor: float = 1.0
    other: int | None = None


def column_errors(study: Study, measured: Measured, prediction: Floats) -> tuple[ColumnError, ...]:
    """Find the channels of a study that were assigned or converted wrongly.

    Args:
        study: the study.
        measured: its readings.
        prediction: readings by a replay of the nominal model, shape (n,).
    """
    swapped = tuple(_swapped(study, measured, prediction))
    known = {error.channel for error in swapped}
    return (*swapped, *_converted(study, measured, prediction, known))


def _converted(
    study: Study, measured: Measured, prediction: Floats, known: set[int]
) -> Iterator[ColumnError]:
    for c, channel in enumerate(study.channels):
        at = measured.channel == c
        value, model = (_about_mean(x, at, measured.episode) for x in (measured.value, prediction))
        if c in known or not _move(measured, at, value, model):
            continue
        correlation = _correlation(value, model)
        if -OPPOSES < correlation < FOLLOWS:
            continue
        slope = float(value @ model / (model @ model))
        sign = "with the opposite sign" if slope < 0.0 else ""
        unit = next((f for f in UNITS if abs(abs(slope) / f - 1.0) < CLOSE), 1.0)
        if unit != 1.0:
            text = f"{channel.name} moves {abs(slope):.3g} times as far as in the model's replay"
            also = f", {sign}" if sign else ""
            sentence = f"{text}{also}: it seems that it {UNITS[unit]}"
            yield ColumnError("unit", c, sentence, float(np.copysign(1.0 / unit, slope)))
        elif slope < 0.0:
            sentence = (
                f"{channel.name} follows the model's replay {sign} (correlation "
                f"{correlation:.2f}): is scale: -1 missing, or an axis of the model mirrored?"
            )
            yield ColumnError("sign", c, sentence, -1.0)


def _swapped(study: Study, measured: Measured, prediction: Floats) -> Iterator[ColumnError]:
    """Yield the channels whose readings follow the replay of another sensor of the same unit."""
    for unit in dict.fromkeys((c.kind, c.unit) for c in study.channels):
        alike = [i for i, c in enumerate(study.channels) if (c.kind, c.unit) == unit]
        rows = [np.flatnonzero(measured.channel == i) for i in alike]
        if len(alike) < 2 or not _same_times(measured, rows):
            continue
        values, models = (
            np.stack([_about_mean(x, at, measured.episode) for at in rows])
            for x in (measured.value, prediction)
        )
        if not np.isfinite(models).all():
            continue
        deviations = [np.maximum(x.std(axis=1), 1e-300) for x in (values, models)]
        follows = np.abs(values @ models.T) / values.shape[1] / np.outer(*deviations)
        for row, column in zip(*linear_sum_assignment(-follows), strict=True):
            own, best = follows[row, row], follows[row, column]
            if row != column and own < STRAYS and best > FOLLOWS:
                here, there = study.channels[alike[row]], study.channels[alike[column]]
                yield ColumnError(
                    "column",
                    alike[column],
                    f"the readings of {here.name} follow the model's replay of {there.name} "
                    f"(correlation {best:.2f}, with its own {own:.2f}): are columns swapped, "
                    "those of the sensors or those of the commands?",
                    other=alike[row],
                )


def _same_times(measured: Measured, rows: list[Ints]) -> bool:
    first = rows[0]
    return all(
        len(at) == len(first)
        and np.array_equal(measured.time[at], measured.time[first])
        and np.array_equal(measured.episode[at], measured.episode[first])
        for at in rows
    )


def _move(measured: Measured, at: Bools, value: Floats, model: Floats) -> bool:
    least = MOVES * float(measured.noise[at].min(initial=np.inf))
    moved = min(float(np.std(value)), float(np.std(model)))
    return bool(np.isfinite(model).all() and moved > least > 0.0)


def _about_mean(values: Floats, at: Bools | Ints, episode: Ints) -> Floats:
    """Return values about their mean in each episode."""
    found, where = values[at].copy(), episode[at]
    for e in np.unique(where):
        found[where == e] -= found[where == e].mean()
    return found


def _correlation(one: Floats, other: Floats) -> float:
    return float(one @ other / np.sqrt((one @ one) * (other @ other)))
