"""Clock lags: by how much the readings of a file lag behind the model's replay of the commands.

A reading that is late by L follows the replay as x(t - L) does. The lag of a file is where the mean
of the squared correlations of its channels is largest. It contains the difference of clocks, the
delay of sensors, and what the model's motors are too fast.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from reality_gap.causes.base import Record
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Reading
from reality_gap.types import Floats

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
        signal
        for c in channels
        if (signal := _signal(replayer, c, measured.readings[c], record)) is not None
    ]
    if not signals:
        return None
    limit = HALF * measured.duration
    lag = _lag(signals, limit if own_clock else min(LATE, limit))
    return lag if _is_clear(lag) else None


class _Signal(NamedTuple):
    """Readings of a channel with the replay of its sensor.

    Attributes:
        time, value: readings, shape (k,).
        at, replayed: the replay, shape (m,).
    """

    time: Floats
    value: Floats
    at: Floats
    replayed: Floats

    def thinned(self) -> _Signal:
        """Return a signal with at most `MOST` of its readings."""
        kept = slice(None, None, len(self.time) // MOST + 1)
        return self._replace(time=self.time[kept], value=self.value[kept])

    def correlation(self, lag: float) -> float:
        """Return the correlation of the readings with the replay that is late by ``lag``."""
        inside = (self.time >= self.at[0] + lag) & (self.time <= self.at[-1] + lag)
        if np.count_nonzero(inside) < FEWEST:
            return 0.0
        replayed = np.interp(self.time[inside] - lag, self.at, self.replayed)
        value = self.value[inside]
        deviations = float(np.std(replayed) * np.std(value))
        if deviations <= 0.0:
            return 0.0
        product = np.mean((replayed - replayed.mean()) * (value - value.mean()))
        return float(product) / deviations


def _signal(replayer: Replayer, c: int, reading: Reading, record: Record) -> _Signal | None:
    """Return readings with their replay; None if they hardly move, or the replay diverges."""
    channel, measured = replayer.system.study.channels[c], replayer.measured
    if channel.kind == "effort" or len(reading.time) < FEWEST:
        return None
    replayed = record.sensors[:, record.column(channel.sensor, channel.component)]
    noise = float(np.min(measured.noise[measured.channel == c]))
    moved = min(float(np.std(reading.value)), float(np.std(replayed)))
    if not np.isfinite(replayed).all() or moved < MOVES * noise:
        return None
    return _Signal(reading.time, reading.value, record.time - record.time[0], replayed)


def _lag(signals: Sequence[_Signal], limit: float) -> ClockLag:
    few = [s.thinned() for s in signals]

    def score(lag: float, compared: Sequence[_Signal] = signals) -> float:
        return float(np.sqrt(np.mean([max(0.0, s.correlation(lag)) ** 2 for s in compared])))

    steps = np.arange(1, int(limit / COARSE) + 1)
    # The smallest lag first: periodic motions have several maxima.
    lags = COARSE * np.concatenate([[0], np.column_stack([steps, -steps]).ravel()])
    coarse = float(max(lags, key=lambda lag: score(lag, few)))
    near = coarse + np.arange(-COARSE, COARSE + FINE / 2, FINE)
    lag = float(max(near, key=score))
    return ClockLag(lag, score(0.0), score(lag))


def _is_clear(lag: ClockLag) -> bool:
    """Return whether the readings follow the replay with the lag, and much less without it."""
    left = (1.0 - lag.after) / max(1.0 - lag.before, 1e-12)
    return lag.after > FOLLOWS and left < BETTER and abs(lag.seconds) >= NOTICED
