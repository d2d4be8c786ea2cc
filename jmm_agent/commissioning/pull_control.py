"""Control periods of a run that pulls muscles: readings in, commands out, and means at rest."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator

import numpy as np

from jmm_agent.commissioning.options import CommissionOptions
from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import MotorControl
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Bools, Floats

LONGEST_STEP = 0.05
"""Time that counts for a step of a command, at most [s]."""
FEWEST = 4
"""Least number of readings of a mean."""
PATIENCE = 4
"""Number of times that a mean is taken until its two halves agree."""
CHANGE = 0.03
"""Largest difference of both halves, as a share of the stroke [1] ..."""
NOISES = 4.0
"""... beside the noise, in standard deviations."""
RECENT = 5
"""Number of readings over which lengths and tensions are averaged while a muscle is tightened."""
MUCH = 1.3
"""A tension above this share of the motors' limit is no tension [1]."""
ROOM = 0.2
"""By how much a pull may raise the tension of any muscle, as a share of the limit [1]."""

Cycles = Generator[Floats, SensorReadings, None]
Means = tuple[Floats, Floats]
"""Mean lengths (m,) [m] and tensions (m,) [N]."""


class PullControl:
    """What a run knows of the robot now, and the limits of its tensions.

    Args:
        muscles: names of the m muscles.
        motors: gains and limit.
        travel: how far the muscles move between the joint limits [m].
        options: how they are pulled.
    """

    def __init__(
        self,
        muscles: tuple[str, ...],
        motors: MotorControl,
        travel: float,
        options: CommissionOptions,
    ) -> None:
        self._muscles, self._motors, self._travel = muscles, motors, travel
        self._limit, self._options = motors.limit, options
        self._stroke = min(options.stroke * travel, options.pull * motors.limit / motors.stiffness)
        count = len(muscles)
        self._time, self._dt, self._largest = -np.inf, 0.0, 0.0
        self._command = np.zeros(count)
        self._lengths, self._tensions = np.zeros((2, count))
        self._over = np.zeros(count, dtype=int)
        self._running = np.zeros(count, dtype=bool)
        self._at_rest: Floats | None = None
        self._recent = deque[Floats](maxlen=RECENT)
        self._noise = np.zeros((2, count))

    def _check_first(self, readings: SensorReadings) -> None:
        """Refuse to hold lengths that are not known."""
        if not np.isfinite(readings.lengths).all():
            dead = self._muscles[int(np.flatnonzero(~np.isfinite(readings.lengths))[0])]
            raise AgentError(
                f"The encoder of {dead} reads no number, so that no command holds it; nothing was "
                "pulled."
            )

    def _accept(self, readings: SensorReadings) -> None:
        """Take over readings; those that are not finite count as the ones before."""
        self._dt, self._time = min(readings.time - self._time, LONGEST_STEP), readings.time
        for name, last in (("lengths", self._lengths), ("tensions", self._tensions)):
            new = getattr(readings, name)
            last[:] = np.where(np.isfinite(new), new, last)
        most = MUCH * self._motors.limit
        possible = self._tensions <= most
        self._largest = max(self._largest, float(np.max(self._tensions, where=possible, initial=0)))
        self._recent.append(np.array([self._lengths, self._tensions]))
        over = (self._tensions > self._limits()) & possible
        self._over = np.where(over, self._over + 1, 0)

    def _limits(self) -> Floats:
        """Tension (m,) [N] above which a pull ends, or above which a muscle at rest is released."""
        share, options = self._motors.limit, self._options
        if self._at_rest is None:
            return np.full(len(self._muscles), options.release * share)
        room = np.minimum(self._at_rest + ROOM * share, options.release * share)
        return np.maximum(np.maximum(options.tension * share, room), self._at_rest + ROOM * share)

    @property
    def _too_much(self) -> Bools:
        """Muscles whose last two readings of the tension were above the limit (m,)."""
        return self._over >= 2

    def _cycle(self) -> Cycles:
        """One control period."""
        readings = yield self._command.copy()
        self._accept(readings)

    def _held(self, seconds: float) -> Generator[Floats, SensorReadings, list[Means]]:
        """Readings of some time in which the commands stay."""
        end, found = self._time + seconds, list[Means]()
        while self._time < end or len(found) < FEWEST:
            yield from self._cycle()
            found.append((self._lengths.copy(), self._tensions.copy()))
        return found

    def _mean(self) -> Generator[Floats, SensorReadings, Means]:
        """Mean readings at rest."""
        yield from self._held(self._options.settle)
        for _ in range(PATIENCE):
            found = yield from self._held(self._options.measure)
            lengths = np.array([lengths for lengths, _ in found])
            half = len(lengths) // 2
            change = np.abs(lengths[half:].mean(axis=0) - lengths[:half].mean(axis=0))
            noise = NOISES * self._noise[0] * np.sqrt(2.0 / half)
            self._running |= change > self._stroke + noise
            if (self._running | (change <= CHANGE * self._stroke + noise)).all():
                break
        return lengths.mean(axis=0), np.mean([tensions for _, tensions in found], axis=0)
