"""Repetition: the periods with which a residual repeats, by epoch folding.

At each period the readings of a channel, less their moving mean over one period, are sorted into
bins of the phase. With the share ``e`` of their variance that the means of the bins explain, n
readings of a channel with unknown variance are by

    -n / 2 log(1 - e)

likelier than without a repetition. The sum over the channels has maxima at the period of an event
that repeats, at multiples of it, and at those of the machine's motion. The latter are left out: at
these, an event cannot be told from an effect of the motion. Source: D. A. Leahy et al., "On
searches for pulsed emission with application to four globular cluster X-ray sources", Astrophysical
Journal 266, 1983.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from reality_gap.causes.base import SearchHints
from reality_gap.simulation.prepared_episode import PreparedEpisode
from reality_gap.study.data import Study
from reality_gap.study.measurements import Measured
from reality_gap.types import Floats, Ints

WIDTH, FEWEST, MOST_BINS = 0.1, 8, 32
"""Width of a bin of the phase [s]; least and largest number of bins."""
MOST = 3
"""Largest number of periods that are found."""
SHOWS = 5.0
"""Log likelihood above that of white noise, in its deviations, from which on a period is found."""
OF_MOTION = 0.3
"""Share of the variance of a command that repeats with a period of the motion."""


class _Signals(NamedTuple):
    """Signals, each sampled in several episodes.

    Attributes:
        time: time in the study or in the episode, shape (n,) [s].
        value: shape (n,).
        signal: index of the signal of each sample, shape (n,).
        part: index of the episode and signal of each sample, ascending, shape (n,).
    """

    time: Floats
    value: Floats
    signal: Ints
    part: Ints


def repeating_periods(
    study: Study, measured: Measured, residual: Floats, hints: SearchHints
) -> tuple[float, ...]:
    """Return those starts of a period at which a residual repeats most, best first [s].

    Args:
        study: the study.
        measured: its readings.
        residual: what is to be explained, shape (n,).
        hints: hints of a parameter that is a period.
    """
    through = hints.period == "study"
    readings = _readings(study, measured, residual, through)
    motion = _motion(study, through)
    length = study.duration if through else max(e.duration for e in study.episodes)
    found = np.array([_likelihood(readings, period) for period in hints.starts])
    best = list[float]()
    for i in np.argsort(-found):
        period = hints.starts[i]
        if found[i] < SHOWS or len(best) == MOST:
            break
        apart = all(abs(1.0 / period - 1.0 / other) > 1.0 / length for other in best)
        if apart and _folded(motion, period)[1].max(initial=0.0) < OF_MOTION:
            best.append(period)
    return tuple(best)


def _likelihood(readings: _Signals, period: float) -> float:
    """Return the log likelihood of a repetition less that of white noise, in its deviations."""
    count, share = _folded(readings, period)
    free = _bins(period) - 1
    by_chance = np.minimum(free / np.maximum(count, 1.0), 0.9)
    gains = -0.5 * count * (np.log1p(-share) - np.log1p(-by_chance))
    return float(np.sum(gains[share > 0.0])) / np.sqrt(0.5 * free * max(1, len(count)))


def _bins(period: float) -> int:
    """Return the number of bins of the phase."""
    return int(np.clip(round(period / WIDTH), FEWEST, MOST_BINS))


def _folded(signals: _Signals, period: float) -> tuple[Floats, Floats]:
    """Return the number of samples of each signal, and the share of variance that repeats."""
    time, value, signal, _ = signals
    bins = _bins(period)
    value = value - _moving_mean(signals, period)
    phase = np.floor(time / period % 1.0 * bins).astype(np.int64) % bins
    count = int(signal.max(initial=-1)) + 1
    cell = signal * bins + phase
    number = np.bincount(cell, minlength=count * bins).reshape(count, bins)
    total = np.bincount(cell, value, minlength=count * bins).reshape(count, bins)
    power = np.bincount(signal, value**2, minlength=count)
    n, mean_power = number.sum(axis=1), total.sum(axis=1) ** 2
    explained = np.sum(total**2 / np.maximum(number, 1), axis=1) - mean_power / np.maximum(n, 1)
    whole = power - mean_power / np.maximum(n, 1)
    share = np.where(whole > 1e-12 * (power + 1e-300), explained / np.maximum(whole, 1e-300), 0.0)
    return n.astype(np.float64), np.clip(share, 0.0, 1.0 - 1e-9)


def _moving_mean(signals: _Signals, width: float) -> Floats:
    """Return the mean of the samples of the same signal and episode within a width [s], (n,)."""
    time, value, _, part = signals
    if not len(time):
        return value
    apart = float(np.ptp(time)) + 2.0 * width
    at = time - time.min() + apart * part
    total = np.concatenate([[0.0], np.cumsum(value)])
    first = np.searchsorted(at, at - 0.5 * width, side="left")
    last = np.searchsorted(at, at + 0.5 * width, side="right")
    return np.asarray((total[last] - total[first]) / (last - first))


def _origins(study: Study, through: bool) -> Floats:
    """Return the time at the start of each episode, shape (episodes,) [s]."""
    lengths = [episode.duration if through else 0.0 for episode in study.episodes]
    return np.cumsum([0.0, *lengths[:-1]])


def _readings(study: Study, measured: Measured, residual: Floats, through: bool) -> _Signals:
    """Return the residuals of all channels."""
    part = measured.episode * len(study.channels) + measured.channel
    order = np.lexsort((measured.time, part))
    time = measured.time + _origins(study, through)[measured.episode]
    return _Signals(time[order], residual[order], measured.channel[order], part[order])


def _motion(study: Study, through: bool) -> _Signals:
    """Return the commands, or the positions where efforts are compared along measured ones."""
    columns = list[tuple[Floats, Floats, int]]()
    for origin, episode in zip(_origins(study, through), study.episodes, strict=True):
        time, values = episode.time, episode.command
        if isinstance(episode, PreparedEpisode):
            time, values = episode.motion.time, episode.motion.qpos
        columns += [(time + origin, column, j) for j, column in enumerate(values.T)]
    if not columns:
        none = np.empty(0)
        return _Signals(none, none, none.astype(np.int64), none.astype(np.int64))
    return _Signals(
        np.concatenate([time for time, _, _ in columns]),
        np.concatenate([value for _, value, _ in columns]),
        np.concatenate([np.full(len(time), j) for time, _, j in columns]),
        np.concatenate([np.full(len(column[0]), k) for k, column in enumerate(columns)]),
    )
