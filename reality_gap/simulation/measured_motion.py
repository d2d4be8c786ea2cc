"""Measured motion: filtered positions for inverse dynamics, with their derivatives.

Positions are low-pass filtered with zero phase and differentiated as splines. Efforts pass the
same filter and another one with a lower cutoff; see `reality_gap.simulation.effort_filter`. Above
the highest frequency at which a position is seen over its noise, computed efforts are noise only.
As this noise is in the regressors of inertias, too, least squares would find them too small (errors
in variables), so the cutoff is no higher than this frequency.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import dct, idct
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.signal import welch

from reality_gap.errors import StudyError
from reality_gap.study.data import Episode, Reading, Study
from reality_gap.types import Bools, Floats

ORDER = 4
"""Order of the Butterworth filter, which passes forwards and backwards."""
DEGREE = 5
"""Degree of the splines by which positions are differentiated; cubic ones lose 0.4 % of a speed
that has seven samples per period."""
KEPT_POWER = 0.999
"""Share of an effort's power above its white noise that is kept; the rest is 3 % of it in RMS."""
MARGIN = 1.5
"""Cutoff over the frequency below which that power lies; the filter passes 96 % there."""
SEEN = 4.0
"""Power of a position, over that of its noise, from which on it is seen."""
SEGMENTS = 16
"""Number of parts of a log, at least, over which the power of a position is averaged."""
SHORTEST_SEGMENT = 64
"""Least number of samples of such a part."""
POSITION_BAND = 1.4
"""Cutoff of the positions over that of the efforts: what is above it is noise, by which computed
dry friction changes its sign."""
HIGHEST = 0.225
"""Largest cutoff of the efforts, times the period of the readings."""
GRID_RATE = 8.0
"""Samples of the motion per period of the cutoff, at least."""
EDGE = 3.0
"""Length that is left out at both ends of an episode, where filters start [periods of the
cutoff]."""
SHORTEST = 7.0
"""Least length of an episode [periods of the cutoff]."""
TOGETHER = 6.0
"""Least length of all episodes together, without their ends [periods of the cutoff]."""
GAP = 0.5
"""Time without a reading from which on samples near it are left out [periods of the cutoff]."""
LOST = 5.0
"""Time without a reading, over the usual one, from which on a spectrum needs it filled."""
SLOW = 0.01
"""Share of its usual speed below which a joint stands still; its dry friction is then unknown."""


@dataclass(frozen=True)
class Motion:
    """Motion of one episode on an even grid of k samples.

    Attributes:
        time: time of each sample, shape (k,) [s].
        qpos, qvel, qacc: positions, velocities and accelerations in SI units, shapes (k, nq),
            (k, nv) and (k, nv).
        cutoff: cutoff of the low-pass filter of the efforts [Hz].
        still: whether each joint stands still, shape (k, nv).
        gaps: begin and end of each time without a position of some joint, shape (g, 2) [s].
    """

    time: Floats
    qpos: Floats
    qvel: Floats
    qacc: Floats
    cutoff: float
    still: Bools
    gaps: Floats

    @property
    def is_read(self) -> Bools:
        """Whether each sample lies outside the gaps, in which the motion is not known, (k,)."""
        read: Bools = np.ones(len(self.time), dtype=bool)
        for begin, end in self.gaps:
            read &= (self.time <= begin) | (self.time >= end)
        return read

    @property
    def step(self) -> float:
        """Time between two samples [s]."""
        return float(self.time[1] - self.time[0])


def period_of(reading: Reading) -> float:
    """Return the usual time between two samples of a reading [s].

    Raises:
        StudyError: there are too few samples.
    """
    if len(reading.time) < 10:
        raise StudyError(
            f"a reading has {len(reading.time)} samples, but inverse dynamics need at least 10"
        )
    return float(np.median(np.diff(reading.time)))


def gaps_of(reading: Reading, cutoff: float) -> Floats:
    """Return begin and end of each gap in a reading that is too long for a filter, (g, 2) [s].

    Args:
        reading: the reading.
        cutoff: cutoff of the low-pass filter of the efforts [Hz].
    """
    long = np.flatnonzero(np.diff(reading.time) > GAP / cutoff)
    return np.stack([reading.time[long], reading.time[long + 1]], axis=1)


def effort_cutoff(
    study: Study, efforts: Sequence[int], columns: Sequence[int], noise: Floats, period: float
) -> float:
    """Return the cutoff of the low-pass filter of the efforts [Hz].

    It is `MARGIN` times the frequency below which `KEPT_POWER` of each effort's power lies, but no
    more than the highest frequency at which a position is seen over its noise.

    Args:
        study: the study.
        efforts: indices of the channels of efforts.
        columns: the channel of the position of each joint, shape (nq,).
        noise: standard deviation of each position, shape (nq,).
        period: of the readings [s].

    Raises:
        StudyError: an effort is constant.
    """
    highest = 0.0
    for c in efforts:
        size = min(4096, *(len(e.readings[c].value) for e in study.episodes))
        frequency, powers = _spectra(study.episodes, c, size)
        white = np.median(powers[:, powers.shape[1] // 2 :], axis=1, keepdims=True)
        total = np.sum(np.maximum(powers - 2 * white, 0.0), axis=0)
        if not np.any(total):
            raise StudyError(f"the effort {study.channels[c].name} is constant")
        share = np.cumsum(total) / np.sum(total)
        highest = max(highest, float(frequency[np.searchsorted(share, KEPT_POWER)]))
    seen = max(
        _highest_seen(study.episodes, c, float(deviation))
        for c, deviation in zip(columns, noise, strict=True)
    )
    return min(MARGIN * highest, seen, HIGHEST / period)


def _highest_seen(episodes: Sequence[Episode], column: int, deviation: float) -> float:
    """Return the highest frequency at which a position is seen over its noise [Hz].

    It is infinite where the position is nowhere seen.
    """
    lengths = [len(e.readings[column].value) for e in episodes]
    size = min(*lengths, max(SHORTEST_SEGMENT, sum(lengths) // SEGMENTS))
    frequency, powers = _spectra(episodes, column, size)
    expected = 2.0 * deviation**2 / (size * frequency[1]) * sum(lengths)
    # The mean, at the frequency 0, was subtracted.
    seen = np.sum(powers, axis=0)[1:] > SEEN * expected
    return float(frequency[1:][seen].max()) if seen.any() else float("inf")


def _spectra(episodes: Sequence[Episode], column: int, size: int) -> tuple[Floats, Floats]:
    """Return frequencies (f,) [Hz], and the power density of a channel in each episode, (e, f).

    The latter is multiplied by the number of the episode's samples.

    Args:
        episodes: e episodes.
        column: the channel.
        size: number of samples of the parts of a log whose powers are averaged.
    """
    rate = 1.0 / max(period_of(e.readings[column]) for e in episodes)
    values = [_filled(e.readings[column]).value for e in episodes]
    powers = [len(value) * welch(value, rate, nperseg=size)[1] for value in values]
    return np.asarray(np.fft.rfftfreq(size, 1.0 / rate)), np.array(powers)


def interpolated(reading: Reading, time: Floats) -> Floats:
    """Return the values of a reading at other times (k,) [s], (k,).

    They are those of a spline, which would swing far out where samples were lost.
    """
    filled = _filled(reading)
    return np.asarray(CubicSpline(filled.time, filled.value)(time))


def _filled(reading: Reading) -> Reading:
    """Return a reading with samples on straight lines where some were lost.

    A jump from one to the other would have all frequencies.
    """
    period = period_of(reading)
    steps = np.diff(reading.time)
    lost = np.where(steps > LOST * period, np.rint(steps / period) - 1, 0).astype(int)
    if not lost.any():
        return reading
    missing = [
        np.linspace(reading.time[i], reading.time[i + 1], lost[i] + 2)[1:-1]
        for i in np.flatnonzero(lost)
    ]
    time = np.sort(np.concatenate([reading.time, *missing]))
    return Reading(time, np.interp(time, reading.time, reading.value))


def measured_motions(
    columns: Sequence[int],
    episodes: Sequence[Episode],
    noise: Floats,
    cutoff: float,
    period: float,
) -> list[Motion]:
    """Return the motion of each episode, from its positions.

    Args:
        columns: the channel of the position of each joint, shape (nq,).
        episodes: the measured positions.
        noise: standard deviation of each position, shape (nq,).
        cutoff: cutoff of the low-pass filter of the efforts [Hz].
        period: of the readings [s].

    Raises:
        StudyError: an episode is too short, or all of them together are.
    """
    spans = [_span(episode) for episode in episodes]
    _check_lengths(episodes, [end - begin for begin, end in spans], cutoff)
    return [
        _motion([e.readings[c] for c in columns], span, noise, cutoff, period)
        for e, span in zip(episodes, spans, strict=True)
    ]


def _span(episode: Episode) -> tuple[float, float]:
    """Return the first and the last time at which all channels are read [s]."""
    times = [r.time for r in episode.readings if len(r.time)]
    return max(float(time[0]) for time in times), min(float(time[-1]) for time in times)


def _check_lengths(episodes: Sequence[Episode], lengths: Sequence[float], cutoff: float) -> None:
    """Raise StudyError if an episode, or all without their ends together, are too short."""
    ends = 2.0 * EDGE / cutoff
    shortest = SHORTEST / cutoff if len(episodes) > 1 else TOGETHER / cutoff + ends
    for episode, length in zip(episodes, lengths, strict=True):
        if length < shortest:
            raise StudyError(
                f"the log {episode.name} lasts {length:.3g} s, which is too short for inverse "
                f"dynamics at {cutoff:.3g} Hz; at least {shortest:.3g} s are needed"
            )
    together = sum(lengths) - ends * len(lengths)
    if together < TOGETHER / cutoff:
        raise StudyError(
            f"without {ends:.3g} s at the ends of each, where filters start, the episodes last "
            f"{together:.3g} s together, which is too short for inverse dynamics at {cutoff:.3g} "
            f"Hz; at least {TOGETHER / cutoff:.3g} s are needed"
        )


def _motion(
    readings: Sequence[Reading],
    span: tuple[float, float],
    noise: Floats,
    cutoff: float,
    period: float,
) -> Motion:
    """Return the motion of one episode between two times [s], from its positions."""
    time = np.arange(span[0], span[1] + 1e-9, period)
    raw = np.stack([interpolated(r, time) for r in readings], axis=1)
    qpos = low_pass(raw, POSITION_BAND * cutoff, period)
    qvel = make_interp_spline(time, qpos, k=DEGREE)(time, 1)
    qacc = make_interp_spline(time, qvel, k=DEGREE)(time, 1)
    stride = max(1, int(1.0 / (GRID_RATE * cutoff * period)))
    kept = slice(None, None, stride)
    still = _standing_still(qvel, noise, cutoff, period)
    gaps = np.concatenate([gaps_of(r, cutoff) for r in readings])
    return Motion(time[kept], qpos[kept], qvel[kept], qacc[kept], cutoff, still[kept], gaps)


def low_pass(signal: Floats, cutoff: float, period: float) -> Floats:
    """Return signals (k, ...) without what is above a cutoff [Hz], with zero phase.

    What is left of a frequency does not depend on the time between samples, since measured efforts
    have more of them than computed ones. Ends are mirrored.
    """
    frequency = np.arange(len(signal)) / (2 * period * (len(signal) - 1))
    share = passed(frequency, cutoff).reshape(-1, *[1] * (signal.ndim - 1))
    return np.asarray(idct(share * dct(signal, type=1, axis=0), type=1, axis=0))


def passed(frequency: Floats, cutoff: float) -> Floats:
    """Return the share of amplitudes at frequencies [Hz] that passes a filter with a cutoff."""
    return np.asarray(1.0 / (1.0 + (frequency / cutoff) ** (2 * ORDER)))


def _standing_still(qvel: Floats, noise: Floats, cutoff: float, period: float) -> Bools:
    """Return whether each joint is slower than the noise of its speed or than `SLOW`, (k, nv)."""
    band = POSITION_BAND * cutoff
    speed_noise = noise * 2 * np.pi * np.sqrt(2 * period * band**3 / 3)
    usual = np.quantile(np.abs(qvel), 0.95, axis=0)
    return np.abs(qvel) <= np.maximum(4 * speed_noise, SLOW * usual)
