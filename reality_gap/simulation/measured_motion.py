"""Measured motion: filters of positions and efforts for inverse dynamics.

Positions are low-pass filtered with zero phase and differentiated by central differences. Efforts
pass a low-pass filter with a lower cutoff, and as many samples are kept as are independent after
it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt, welch

from reality_gap.errors import StudyError
from reality_gap.study.data import Episode, Reading, Study
from reality_gap.types import Bools, Floats

KEPT_POWER = 0.999
"""Share of an effort's power above its white noise that is kept; the rest is 3 % of it in RMS."""
MARGIN = 1.5
"""Cutoff over the frequency below which that power lies; the filter passes 96 % there."""
POSITION_BAND = 4.0
"""Cutoff of the positions over that of the efforts, so that it does not affect the efforts."""
GRID_RATE = 8.0
"""Samples of the motion per period of the cutoff, at least."""
EDGE = 3.0
"""Length that is left out at both ends of a log, where filters start [periods of the cutoff]."""
LEAST = 10
"""Number of samples in motion below which an effort is not compared."""
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
    """

    time: Floats
    qpos: Floats
    qvel: Floats
    qacc: Floats
    cutoff: float

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


def effort_cutoff(study: Study, efforts: Sequence[int], period: float) -> float:
    """Return the cutoff of the low-pass filter of the efforts [Hz].

    It is `MARGIN` times the frequency below which `KEPT_POWER` of each effort's power lies.

    Args:
        study: the study.
        efforts: indices of the channels of efforts.
        period: of the readings [s].

    Raises:
        StudyError: an effort is constant.
    """
    highest = 0.0
    for c in efforts:
        total = frequency = np.zeros(1)
        size = min(4096, *(len(e.readings[c].value) for e in study.episodes))
        for episode in study.episodes:
            value = episode.readings[c].value
            frequency, power = welch(value, 1.0 / period, nperseg=size)
            noise = np.median(power[len(power) // 2 :])
            total = total + np.maximum(power - 2 * noise, 0.0) * len(value)
        if not np.any(total):
            raise StudyError(f"the effort {study.channels[c].name} is constant")
        share = np.cumsum(total) / np.sum(total)
        highest = max(highest, float(frequency[np.searchsorted(share, KEPT_POWER)]))
    return min(MARGIN * highest, 0.45 / (POSITION_BAND * period))


def measured_motion(
    columns: Sequence[int], episode: Episode, cutoff: float, period: float
) -> Motion:
    """Return the motion of an episode, from its positions.

    Args:
        columns: the channel of the position of each joint, shape (nq,).
        episode: the measured positions.
        cutoff: cutoff of the low-pass filter of the efforts [Hz].
        period: of the readings [s].

    Raises:
        StudyError: the log is too short.
    """
    readings = [episode.readings[c] for c in columns]
    begin = max(r.time[0] for r in episode.readings if len(r.time))
    end = min(r.time[-1] for r in episode.readings if len(r.time))
    if end - begin < 20.0 / cutoff:
        raise StudyError(
            f"the log {episode.name} lasts {end - begin:.3g} s, which is too short for inverse "
            f"dynamics at {cutoff:.3g} Hz; at least {20.0 / cutoff:.3g} s are needed"
        )
    time = np.arange(begin, end + 1e-9, period)
    raw = np.stack([CubicSpline(r.time, r.value)(time) for r in readings], axis=1)
    sections = butter(4, 2 * POSITION_BAND * cutoff * period, output="sos")
    qpos = sosfiltfilt(sections, raw, axis=0)
    qvel = np.gradient(qpos, period, axis=0)
    qacc = np.gradient(qvel, period, axis=0)
    stride = max(1, int(1.0 / (GRID_RATE * cutoff * period)))
    kept = slice(None, None, stride)
    return Motion(time[kept], qpos[kept], qvel[kept], qacc[kept], cutoff)


def standing_still(motion: Motion, noise: Floats, period: float) -> Bools:
    """Return whether each joint is slower than the noise of its speed or than `SLOW`, (k, nv)."""
    band = POSITION_BAND * motion.cutoff
    speed_noise = noise * 2 * np.pi * np.sqrt(2 * period * band**3 / 3)
    usual = np.quantile(np.abs(motion.qvel), 0.95, axis=0)
    return np.abs(motion.qvel) < np.maximum(4 * speed_noise, SLOW * usual)


def filtered_effort(motion: Motion, reading: Reading, still: Bools, period: float) -> Reading:
    """Return the independent samples of a measured effort after the low-pass filter.

    Samples at which the joint stands still are left out, and all if fewer than `LEAST` remain.

    Args:
        motion: the motion along which it was measured.
        reading: the effort.
        still: where its joint stands still, shape (k,).
        period: of the readings [s].
    """
    time = np.arange(motion.time[0], motion.time[-1] + 1e-9, period)
    value = low_pass(np.interp(time, reading.time, reading.value), motion.cutoff, period)
    step = max(1, round(0.5 / (motion.cutoff * motion.step)))
    edge = int(np.ceil(EDGE / (motion.cutoff * motion.step)))
    kept = np.arange(edge, len(motion.time) - edge, step)
    kept = kept[~still[kept]]
    if len(kept) < LEAST:
        kept = kept[:0]
    return Reading(motion.time[kept], np.interp(motion.time[kept], time, value))


def low_pass(effort: Floats, cutoff: float, period: float) -> Floats:
    """Return efforts (k, ...) without what is above a cutoff [Hz], with zero phase."""
    return sosfiltfilt(butter(4, 2 * cutoff * period, output="sos"), effort, axis=0)
