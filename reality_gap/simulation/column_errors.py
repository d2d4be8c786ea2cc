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
        cycle: indices of the channels that are swapped, if ``kind`` is "column": the readings of
            each one belong to the one before it.
    """

    kind: Literal["sign", "unit", "column"]
    channel: int
    sentence: str
    factor: float = 1.0
    cycle: tuple[int, ...] = ()


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
        rows_of = np.argsort(linear_sum_assignment(-follows)[1])  # whose readings belong to each
        moves = [_move(measured, *one) for one in zip(rows, values, models, strict=True)]
        for cycle in _cycles(rows_of):
            pairs = list(zip(cycle, (*cycle[1:], cycle[0]), strict=True))
            if not all(
                moves[c] and follows[r, r] < STRAYS and follows[r, c] > FOLLOWS for c, r in pairs
            ):
                continue
            for c, r in pairs:
                here, there = study.channels[alike[r]], study.channels[alike[c]]
                yield ColumnError(
                    "column",
                    alike[c],
                    f"the readings of {here.name} follow the model's replay of {there.name} "
                    f"(correlation {follows[r, c]:.2f}, with its own {follows[r, r]:.2f}): are "
                    "columns swapped, those of the sensors or those of the commands?",
                    cycle=tuple(alike[i] for i in cycle),
                )


def _cycles(permutation: Ints) -> Iterator[tuple[int, ...]]:
    """Yield the cycles of a permutation that have at least two members."""
    left = set(range(len(permutation)))
    while left:
        cycle = [left.pop()]
        while (following := int(permutation[cycle[-1]])) in left:
            left.remove(following)
            cycle.append(following)
        if len(cycle) > 1:
            yield tuple(cycle)


def _same_times(measured: Measured, rows: list[Ints]) -> bool:
    first = rows[0]
    return all(
        len(at) == len(first)
        and np.array_equal(measured.time[at], measured.time[first])
        and np.array_equal(measured.episode[at], measured.episode[first])
        for at in rows
    )


def _move(measured: Measured, at: Bools | Ints, value: Floats, model: Floats) -> bool:
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
