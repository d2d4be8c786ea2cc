"""Clocks: readings and commands at other times, and delays that every replay may have."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from reality_gap.causes.base import Record
from reality_gap.study.system import System
from reality_gap.types import Floats

LEAST = 0.6
"""Delay up to which it is not named, in time steps of the model: an integrator may be late or early
by half a step, more or less for each kind of sensor."""


def least_delay(system: System) -> float:
    """Return the delay up to which it is not named [s]."""
    return LEAST * float(system.model.opt.timestep)


def read_at(record: Record, sensors: Iterable[str], then: Floats, time: Floats) -> None:
    """Replace readings by those of other times.

    Args:
        record: edited in place.
        sensors: names of the sensors, each once.
        then: times of the new readings, shape (k,) [s].
        time: times of the readings before, on the same clock, shape (k,) [s].
    """
    for name in sensors:
        for i in range(int(record.model.sensor(name).dim[0])):
            column = record.column(name, i)
            record.sensors[:, column] = np.interp(then, time, record.sensors[:, column])


def delayed(time: Floats, command: Floats, columns: Sequence[int], delay: float) -> Floats:
    """Return commands some columns of which act later, shape (k, nu).

    Args:
        time: time of each command, shape (k,) [s].
        command: commands, shape (k, nu).
        columns: columns of the commands that act later.
        delay: how much later [s]; they act earlier if it is negative.
    """
    found = command.copy()
    for i in columns:
        found[:, i] = np.interp(time - delay, time, command[:, i])
    return found
