"""Clocks that are not exact: the time stamps that an agent is given, and cycles that it misses.

The simulation keeps its own time, and takes its readings in every cycle. A clock changes what the
agent gets: stamps that deviate, repeat or go back, cycles that are lost or late.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from kengoro.errors import UsageError


class Cycle(NamedTuple):
    """What the agent gets of one control cycle.

    Attributes:
        stamp: time stamp of the readings [s].
        lost: whether neither readings nor command arrive; the robot holds the last command.
        late: whether the command arrives in the next cycle.
    """

    stamp: float
    lost: bool = False
    late: bool = False


@dataclass(frozen=True)
class Clock:
    """Clock of a control loop.

    Attributes:
        jitter: largest deviation of a stamp from its moment [s].
        offset: stamp of the beginning [s]; 1.7e9 for seconds since 1970.
        lost: share of cycles that are lost.
        late: share of cycles that are late: their stamps by up to a period, their commands by one.
        repeated: share of cycles with the stamp of the one before.
        backward: share of cycles with a stamp that is up to `back` too early.
        back: [s].
        set_at: moment at which the clock is set [s].
        set_by: how far it is set forward then, or back if negative [s].

    Raises:
        UsageError: a value is not finite, or a share is not from 0 to 1.
    """

    jitter: float = 0.0
    offset: float = 0.0
    lost: float = 0.0
    late: float = 0.0
    repeated: float = 0.0
    backward: float = 0.0
    back: float = 0.1
    set_at: float = 0.0
    set_by: float = 0.0

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            if not np.isfinite(value):
                raise UsageError(f"Clock: {entry.name} is {value}, but must be finite.")
        for name in ("lost", "late", "repeated", "backward"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise UsageError(f"Clock: {name} is {getattr(self, name)}, but is a share of 1.")

    def at(self, moment: float) -> float:
        """What the clock shows at a moment [s], without deviations."""
        since = self.set_by if self.set_by and moment >= self.set_at else 0.0
        return moment + self.offset + since

    def cycles(self, period: float, seed: int) -> Iterator[Cycle]:
        """Endless cycles of an episode; the first is neither lost nor late.

        Args:
            period: time between two cycles [s].
            seed: of the deviations.
        """
        return _Cycles(self, period, np.random.default_rng([seed, 11]))


class _Cycles:
    """Cycles of a clock; unlike a generator, it can be copied together with its session."""

    def __init__(self, clock: Clock, period: float, rng: np.random.Generator) -> None:
        self._clock, self._period, self._rng = clock, period, rng
        self._before, self._step = clock.offset, 0

    def __iter__(self) -> _Cycles:
        return self

    def __next__(self) -> Cycle:
        clock, step = self._clock, self._step
        deviation, share, more = self._rng.random(3)
        shares = clock.lost, clock.late, clock.repeated, clock.backward
        lost, late, repeated, backward = self._rng.random(4) < (shares if step else (0.0,) * 4)
        stamp = clock.at(step * self._period) + clock.jitter * (2.0 * deviation - 1.0)
        if late:
            stamp += share * self._period
        if backward:
            stamp -= more * clock.back
        if repeated:
            stamp = self._before
        self._before, self._step = stamp, step + 1
        return Cycle(float(stamp), bool(lost), bool(late))
