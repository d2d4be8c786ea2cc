"""Clock lags: by how much the readings of a file lag behind the model's replay of the commands.

A reading that is late by L follows the replay as x(t - L) does. The lag of a file is where the mean
of the squared correlations of its channels is largest, if its positions and velocities follow much
better there, too. It contains the difference of clocks, the delay of sensors, and what the model's
motors are too fast.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from reality_gap.causes.base import Record
from reality_gap.simulation.replay import command_rows, is_force, read_sensors
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Episode
from reality_gap.types import Floats, Ints

COARSE, FINE = 0.02, 0.001
"""Steps of the search for a lag [s]."""
LATE = 1.0
"""Largest lag if both files have one clock [s]."""
HALF = 0.5
"""Largest lag if they have not, as a share of the episode."""
MOVES = 3.0
"""Standard deviation of a reading and of its replay from which on they are compared [noise]."""
FEWEST = 20
"""Number of readings from which on a channel is compared."""
MOST = 2000
"""Largest number of readings of a channel that the search in steps of `COARSE` compares."""
FOLLOWS = 0.9
"""Mean correlation from which on readings follow the replay."""
BETTER = 0.5
"""Share of what is not correlated that may be left with the lag."""
NOTICED = 0.005
"""Lag from which on it is reported [s]."""


class ClockLag(NamedTuple):
    """Lag of readings behind the replay.

    Attributes:
        seconds: how late the readings are [s].
        before, after: root mean square of the correlations without and with the lag.
    """

    seconds: float
    before: float
    after: float


def clock_lag(
    replayer: Replayer,
    record: Record,
    episode: int,
    channels: Sequence[int],
    own_clock: bool = False,
) -> ClockLag | None:
    """Return the lag of some channels in an episode; None if there is no clear one.

    Args:
        replayer: replays the study.
        record: the replay of the episode.
        episode: index of the episode.
        channels: indices of the channels that have one clock.
        own_clock: whether this clock has nothing in common with that of the commands.
    """
    measured = replayer.system.study.episodes[episode]
    signals = [
        signal for c in channels if (signal := _signal(replayer, c, measured, record)) is not None
    ]
    if not signals:
        return None
    limit = HALF * measured.duration
    lag = _lag(signals, limit if own_clock else min(LATE, limit))
    # Forces may be late because motors are.
    motion = [s for s in signals if not s.forces] or signals
    moved = ClockLag(lag.seconds, _score(motion, 0.0), _score(motion, lag.seconds))
    return lag if _is_clear(lag) and _is_better(moved) else None


class _Signal(NamedTuple):
    """Readings of a channel with the replay of its sensor.

    Attributes:
        time, value: readings, shape (k,).
        record, episode, rows: the replay, the commands, and when these act; see `read_sensors`.
        column: of the sensor in the replay.
        forces: whether the readings are forces.
    """

    time: Floats
    value: Floats
    record: Record
    episode: Episode
    rows: Ints
    column: int
    forces: bool

    def thinned(self) -> _Signal:
        """Return a signal with at most `MOST` of its readings."""
        kept = slice(None, None, len(self.time) // MOST + 1)
        return self._replace(time=self.time[kept], value=self.value[kept])

    def correlation(self, lag: float) -> float:
        """Return the correlation of the readings with the replay that is late by ``lag``."""
        time, end = self.time - lag, self.record.time[-1] - self.record.time[0]
        # A force that is read at the first command belongs to one before the log.
        inside = (time > 1e-9 if self.forces else time >= 0.0) & (time <= end)
        if np.count_nonzero(inside) < FEWEST:
            return 0.0
        time, value = time[inside], self.value[inside]
        replayed = read_sensors(
            self.record, self.episode, self.rows, time, self.column, self.forces
        )
        deviations = float(np.std(replayed) * np.std(value))
        if deviations <= 0.0:
            return 0.0
        product = np.mean((replayed - replayed.mean()) * (value - value.mean()))
        return float(product) / deviations


def _signal(replayer: Replayer, c: int, episode: Episode, record: Record) -> _Signal | None:
    """Return readings with their replay; None if they hardly move, or the replay diverges."""
    channel, measured = replayer.system.study.channels[c], replayer.measured
    reading = episode.readings[c]
    if channel.kind == "effort" or len(reading.time) < FEWEST:
        return None
    column = record.column(channel.sensor, channel.component)
    replayed = record.sensors[:, column]
    noise = float(np.min(measured.noise[measured.channel == c]))
    moved = min(float(np.std(reading.value)), float(np.std(replayed)))
    if not np.isfinite(replayed).all() or moved < MOVES * noise:
        return None
    forces = is_force(record.model, channel.sensor)
    rows = command_rows(record.model, episode)
    return _Signal(reading.time, reading.value, record, episode, rows, column, forces)


def _score(signals: Sequence[_Signal], lag: float) -> float:
    """Return the root mean square of the correlations with a lag; those below 0 count as 0."""
    return float(np.sqrt(np.mean([max(0.0, s.correlation(lag)) ** 2 for s in signals])))


def _lag(signals: Sequence[_Signal], limit: float) -> ClockLag:
    few = [s.thinned() for s in signals]
    steps = np.arange(1, int(limit / COARSE) + 1)
    # The smallest lag first: periodic motions have several maxima.
    lags = COARSE * np.concatenate([[0], np.column_stack([steps, -steps]).ravel()])
    coarse = float(max(lags, key=lambda lag: _score(few, lag)))
    near = coarse + np.arange(-COARSE, COARSE + FINE / 2, FINE)
    lag = float(max(near, key=lambda lag: _score(signals, lag)))
    return ClockLag(lag, _score(signals, 0.0), _score(signals, lag))


def _is_clear(lag: ClockLag) -> bool:
    """Return whether the readings follow the replay with the lag, and much less without it."""
    return lag.after > FOLLOWS and _is_better(lag) and abs(lag.seconds) >= NOTICED


def _is_better(lag: ClockLag) -> bool:
    """Return whether much less is not correlated with the lag than without it."""
    return (1.0 - lag.after) / max(1.0 - lag.before, 1e-12) < BETTER
