"""What was measured, as one vector: every reading of every channel of every episode."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from reality_gap.study.data import Reading, Study
from reality_gap.types import Floats, Ints


@dataclass(frozen=True)
class Measured:
    """All readings, episode by episode and, within, channel by channel.

    Attributes:
        value: (n,) in SI units.
        noise: (n,) standard deviation of the reading.
        channel, episode: (n,) indices into the study's.
        time: (n,) [s] from the first command of the episode.
        quaternions: (q, 4) indices of readings that are one quaternion.
    """

    value: Floats
    noise: Floats
    channel: Ints
    episode: Ints
    time: Floats
    quaternions: Ints

    def align(self, prediction: Floats) -> Floats:
        """Turn predicted quaternions to the measured side of the sphere: q and -q are one."""
        if len(self.quaternions):
            measured, predicted = self.value[self.quaternions], prediction[self.quaternions]
            flip = np.sum(measured * predicted, axis=1) < 0
            prediction[self.quaternions[flip]] *= -1
        return prediction


def measured(study: Study) -> Measured:
    """Lay the study's readings end to end."""
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
    """Standard deviation of one reading by channel (c,): as the study says, or from the log."""
    stated = [channel.noise for channel in study.channels]
    rough = rough_noise(study)
    return np.array([r if n is None else n for n, r in zip(stated, rough, strict=True)])


def rough_noise(study: Study) -> Floats:
    """Standard deviation of one reading by channel (c,), from the log alone."""
    count = range(len(study.channels))
    return np.array([_rough(tuple(e.readings[c] for e in study.episodes)) for c in count])


def _rough(readings: tuple[Reading, ...]) -> float:
    """Noise of a smooth signal: the median third difference, which the motion hardly enters."""
    thirds = [np.diff(r.value, 3) for r in readings if len(r.value) > 8]
    values = np.concatenate([r.value for r in readings])
    floor = 1e-6 * float(np.ptp(values)) + 1e-12
    if not thirds:
        return max(0.01 * float(np.std(values)), floor)
    deviation = 1.4826 * float(np.median(np.abs(np.concatenate(thirds)))) / np.sqrt(20.0)
    return max(deviation, floor)


def _quaternion_sensors(study: Study) -> dict[str, list[int]]:
    """Channels of every sensor that reads a whole quaternion."""
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
