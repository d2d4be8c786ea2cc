"""Measurements as one vector: all readings of all channels in all episodes.

The error of a sensor has two parts: noise, and rounding to the step of its converter. Rounding has
a variance of step^2 / 12. It is the same in all readings of a run of equal values, which together
count as one reading, unless the values go on in one direction: then it rises or falls from one half
of a step to the other, and its mean is zero. A run that is much longer than others of that kind is
a pause, in which the error stays the same. The repeats of a sensor that is slower than its log and
whose values are held count as one reading, too. Where a replay shows the motion, the readings that
share an error by rounding are found by `reality_gap.study.rounding`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from reality_gap.study.data import Reading, Study
from reality_gap.types import Floats, Ints

MULTIPLE, MOSTLY = 0.1, 0.95
"""Distance from a multiple of the step, in steps, up to which differences between the values of a
channel count as multiples; share of them that must be."""
USUAL_STEPS = 20.0
"""Median of these differences in steps; a larger one shows no converter."""
SINGLE = 1.5
"""Change of a value, in steps of its converter, below which it is by one step."""
PAUSE, BRIEF = 5.0, 0.01
"""Length of a run in which the motion pauses, over the mean of those in which it goes on; share of
an episode up to which a run is no pause."""
FEW = 4
"""Number of different values below which no step is recognised."""
BLOCK, IN_PART = 0.25, 2.9
"""Length of a block of readings of one role [s], and how many there are between two restarts at
least; see `reality_gap.study.splits`."""


@dataclass(frozen=True)
class Measured:
    """All readings of a study, ordered by episode and then by channel.

    Attributes:
        value: readings in SI units, shape (n,).
        noise: standard deviation of each reading in SI units, shape (n,).
        channel, episode: indices into the study's channels and episodes, shape (n,).
        time: time from the first command of the episode, shape (n,) [s].
        quaternions: indices of four readings that form one quaternion, shape (q, 4).
        block: length of a block of one role; see `reality_gap.study.splits` [s].
    """

    value: Floats
    noise: Floats
    channel: Ints
    episode: Ints
    time: Floats
    quaternions: Ints
    block: float = BLOCK

    def align(self, prediction: Floats) -> Floats:
        """Flip predicted quaternions that have the opposite sign of the measured ones, in place.

        q and -q are the same orientation.

        Args:
            prediction: predicted readings, shape (n,).

        Returns:
            ``prediction``.
        """
        if len(self.quaternions):
            measured, predicted = self.value[self.quaternions], prediction[self.quaternions]
            flip = np.sum(measured * predicted, axis=1) < 0
            prediction[self.quaternions[flip]] *= -1
        return prediction


def measured(study: Study) -> Measured:
    """Concatenate the study's readings."""
    values, channels, episodes, times, noises, quaternions = [], [], [], [], [], []
    step = rounding_steps(study)
    hold = values_held(study, step)
    noise = _channel_noise(study, step)
    four = _quaternion_sensors(study)
    start = 0
    for e, episode in enumerate(study.episodes):
        first: dict[str, list[int]] = {}
        for c, reading in enumerate(episode.readings):
            count = len(reading.time)
            values.append(reading.value)
            times.append(reading.time)
            channels.append(np.full(count, c))
            episodes.append(np.full(count, e))
            held = hold[c] > 1
            shared = noise[c] if held else step[c] / np.sqrt(12.0)
            repeats = _repeats(reading.value, passing=held)
            noises.append(np.sqrt(noise[c] ** 2 + repeats * shared**2))
            if study.channels[c].sensor in four:
                first.setdefault(study.channels[c].sensor, []).append(start)
            start += count
        for sensor, starts in first.items():
            counts = {len(episode.readings[c].time) for c in four[sensor]}
            if len(starts) == 4 and len(counts) == 1:
                quaternions.append(np.array(starts) + np.arange(counts.pop())[:, None])
    return Measured(
        np.concatenate(values),
        np.concatenate(noises),
        np.concatenate(channels),
        np.concatenate(episodes),
        np.concatenate(times),
        np.concatenate(quaternions) if quaternions else np.zeros((0, 4), dtype=np.int64),
        min(BLOCK, study.restart / IN_PART) if study.restart else BLOCK,
    )


def channel_noise(study: Study) -> Floats:
    """Return the standard deviation of one reading of each channel in SI units, shape (c,).

    It is the study's value if there is one, and else an estimate from the log; but at least the
    error by rounding.
    """
    return _channel_noise(study, rounding_steps(study))


def _channel_noise(study: Study, steps: Floats) -> Floats:
    """Return the noise of each channel, given the steps (c,) to which they are rounded."""
    found = []
    for c, channel in enumerate(study.channels):
        readings = tuple(episode.readings[c] for episode in study.episodes)
        found.append(
            _rough(readings) if channel.noise is None else channel.noise or _least(readings)
        )
    return np.maximum(found, steps / np.sqrt(12.0))


def rounding_steps(study: Study) -> Floats:
    """Return the step to which each channel is rounded in SI units, shape (c,); 0 if to none."""
    count = range(len(study.channels))
    return np.array([_step(tuple(e.readings[c] for e in study.episodes)) for c in count])


def _step(readings: tuple[Reading, ...]) -> float:
    """Return the step of which nearly all differences between the values are multiples, or 0."""
    values = np.unique(np.concatenate([reading.value for reading in readings]))
    if len(values) < FEW:
        return 0.0
    gaps = np.diff(values)
    gaps = gaps[gaps > 1e-9 * (values[-1] - values[0])]  # equal but for the conversion of units
    steps = gaps / gaps.min()
    multiple = np.abs(steps - np.round(steps)) < MULTIPLE
    rounded = np.mean(multiple) > MOSTLY and np.median(steps) < USUAL_STEPS
    return float(np.median(gaps / np.round(steps))) if rounded else 0.0


def values_held(study: Study, steps: Floats) -> Ints:
    """Return the number of rows for which each channel usually holds a value, shape (c,).

    Values that mostly change by one step of their converter (c,) are not held, but change slowly.
    """
    found = []
    for c, step in enumerate(steps):
        readings = tuple(episode.readings[c] for episode in study.episodes)
        jumps = np.concatenate([np.abs(np.diff(reading.value)) for reading in readings])
        jumps = jumps[jumps > 0.0]
        slow = len(jumps) > 0 and np.median(jumps) < SINGLE * step
        found.append(1 if slow else _hold(readings))
    return np.array(found)


def _hold(readings: tuple[Reading, ...]) -> int:
    """Return the median number of rows for which a channel holds a value; 1 if it never moves."""
    lengths = [_lengths(reading.value) for reading in readings]
    together = np.concatenate(lengths)
    return int(np.ceil(np.median(together))) if len(together) >= FEW + len(lengths) else 1


def _repeats(values: Floats, passing: bool) -> Floats:
    """Return how many readings beside each one have the same error, shape (k,).

    Args:
        values: readings (k,).
        passing: whether that includes all runs of equal values between a lower and a higher value,
            not only those in which the motion pauses.
    """
    lengths = _lengths(values)
    repeats = lengths - 1
    if not passing and len(lengths) > 2:
        rises = np.sign(np.diff(values[np.cumsum(lengths) - 1]))
        goes_on, inner = rises[1:] == rises[:-1], lengths[1:-1]
        usual = np.mean(inner[goes_on]) if goes_on.any() else 0.0
        pauses = inner > max(PAUSE * usual, BRIEF * len(values))
        repeats[1:-1][goes_on & ~pauses] = 0
    return np.repeat(repeats, lengths).astype(np.float64)


def _lengths(values: Floats) -> Ints:
    """Return the lengths of the runs of equal values."""
    starts = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
    return np.diff(starts, append=len(values))


def with_estimated_noise(study: Study, readings: Measured, prediction: Floats) -> Study:
    """Return a study in which errors of a prediction show the noise of channels without one.

    In a slow log of a quick motion, the motion itself looks like noise. A prediction contains most
    of it, and what it lacks can only make the noise too large.

    Args:
        study: the study.
        readings: its readings.
        prediction: predicted readings, shape (n,); NaN where a replay diverged.
    """
    found, hold = channel_noise(study), values_held(study, rounding_steps(study))
    for c, channel in enumerate(study.channels):
        at = readings.channel == c
        error = readings.value - prediction
        if channel.noise is not None or hold[c] > 1 or not np.all(np.isfinite(error[at])):
            continue
        own = [at & (readings.episode == e) for e in np.unique(readings.episode[at])]
        errors = tuple(Reading(readings.time[rows], error[rows]) for rows in own)
        if any(len(one.time) > 8 for one in errors):
            found[c] = min(found[c], _rough(errors))
    estimated = zip(study.channels, found, strict=True)
    channels = tuple(c if c.noise is not None else replace(c, noise=float(n)) for c, n in estimated)
    return replace(study, channels=channels)


def rough_noise(study: Study) -> Floats:
    """Estimate the standard deviation of one reading of each channel from the log, shape (c,)."""
    count = range(len(study.channels))
    return np.array([_rough(tuple(e.readings[c] for e in study.episodes)) for c in count])


def _rough(readings: tuple[Reading, ...]) -> float:
    """Estimate the noise of a smooth signal from the median of its third differences.

    Third differences suppress the motion; those of white noise have 20 times its variance. Of
    values that are held, one each is used.
    """
    hold = _hold(readings)
    thirds = [np.diff(r.value[::hold], 3) for r in readings if len(r.value[::hold]) > 8]
    if not thirds:
        values = np.concatenate([r.value for r in readings])
        return max(0.01 * float(np.std(values)), _least(readings))
    deviation = 1.4826 * float(np.median(np.abs(np.concatenate(thirds)))) / np.sqrt(20.0)
    return max(deviation, _least(readings))


def _least(readings: tuple[Reading, ...]) -> float:
    """Return the least noise of a channel: computed values have none, and residuals need some."""
    return 1e-6 * float(np.ptp(np.concatenate([r.value for r in readings]))) + 1e-12


def _quaternion_sensors(study: Study) -> dict[str, list[int]]:
    """Return the channel indices of each sensor that measures a quaternion."""
    spec = study.spec()
    kinds = {s.name: s.type for s in spec.sensors}
    quaternion = (
        mujoco.mjtSensor.mjSENS_FRAMEQUAT,
        mujoco.mjtSensor.mjSENS_BALLQUAT,
    )
    found: dict[str, list[int]] = {}
    for c, channel in enumerate(study.channels):
        if channel.kind == "sensor" and kinds.get(channel.sensor) in quaternion:
            found.setdefault(channel.sensor, []).append(c)
    return found
