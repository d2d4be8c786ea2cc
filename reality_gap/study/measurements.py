"""Measurements as one vector: all readings of all channels in all episodes."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from reality_gap.study.data import Reading, Study
from reality_gap.types import Floats, Ints


@dataclass(frozen=True)
class Measured:
    """All readings of a study, ordered by episode and then by channel.

    Attributes:
        value: readings in SI units, shape (n,).
        noise: standard deviation of each reading in SI units, shape (n,).
        channel, episode: indices into the study's channels and episodes, shape (n,).
        time: time from the first command of the episode, shape (n,) [s].
        quaternions: indices of four readings that form one quaternion, shape (q, 4).
    """

    value: Floats
    noise: Floats
    channel: Ints
    episode: Ints
    time: Floats
    quaternions: Ints

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
    noise = channel_noise(study)
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
            noises.append(np.full(count, noise[c]))
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
    )


def channel_noise(study: Study) -> Floats:
    """Return the standard deviation of one reading of each channel in SI units, shape (c,).

    It is the study's value if there is one, and else an estimate from the log.
    """
    stated = [channel.noise for channel in study.channels]
    rough = rough_noise(study)
    return np.array([r if n is None else n for n, r in zip(stated, rough, strict=True)])


def rough_noise(study: Study) -> Floats:
    """Estimate the standard deviation of one reading of each channel from the log, shape (c,)."""
    count = range(len(study.channels))
    return np.array([_rough(tuple(e.readings[c] for e in study.episodes)) for c in count])


def _rough(readings: tuple[Reading, ...]) -> float:
    """Estimate the noise of a smooth signal from the median of its third differences.

    Third differences suppress the motion; those of white noise have 20 times its variance.
    """
    thirds = [np.diff(r.value, 3) for r in readings if len(r.value) > 8]
    values = np.concatenate([r.value for r in readings])
    floor = 1e-6 * float(np.ptp(values)) + 1e-12
    if not thirds:
        return max(0.01 * float(np.std(values)), floor)
    deviation = 1.4826 * float(np.median(np.abs(np.concatenate(thirds)))) / np.sqrt(20.0)
    return max(deviation, floor)


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
