"""Sensors: readings of encoders and tension sensors, of one robot or of many at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from kengoro_env.robot.draft import SensorErrors
from kengoro_env.types import Floats

Noise = Callable[[int], Floats]
"""Function that samples standard normal noise (k, m) for k kinds of sensors."""


class Sensors:
    """Encoders and tension sensors of the muscles.

    Lengths and tensions are (m,), or (count, m) of many robots. A sensor without errors returns
    the array that it is given.

    Args:
        sensor_errors: errors of the sensors.
        muscles: names of the muscles.

    Attributes:
        length_offset: offsets of the encoders (m,) [m]; None: no offset.
    """

    def __init__(self, sensor_errors: SensorErrors, muscles: Sequence[str]) -> None:
        # NumPy is faster with an array than with a number.
        self._length_noise, self._length_quantum, self._tension_noise = (
            np.full(len(muscles), value) if value else None
            for value in (
                sensor_errors.length_noise,
                sensor_errors.length_quantum,
                sensor_errors.tension_noise,
            )
        )
        self._none = np.zeros(len(muscles))
        self.length_offset = _of_each(sensor_errors.length_offset, muscles)
        self._tension_offset = _of_each(sensor_errors.tension_offset, muscles)

    @property
    def kinds_of_noise(self) -> int:
        """Number of kinds of sensors that have noise."""
        return sum(noise is not None for noise in (self._length_noise, self._tension_noise))

    def layout(self) -> dict[str, Floats | None]:
        """Values of the fields of ``Step`` in control_step.c, arrays (m,); None: no such error."""
        return {
            "length_offset": self.length_offset,
            "length_noise": self._length_noise,
            "length_quantum": self._length_quantum,
            "tension_offset": self._tension_offset,
            "tension_noise": self._tension_noise,
        }

    def read(self, lengths: Floats, tensions: Floats, noise: Noise) -> tuple[Floats, Floats]:
        """Readings of lengths [m] and tensions [N], with the noise of the lengths sampled first.

        Args:
            lengths: true lengths (m,) [m].
            tensions: true tensions (m,) [N].
            noise: samples the noise.
        """
        if self._length_noise is None or self._tension_noise is None:
            return self.read_lengths(lengths, noise), self.read_tensions(tensions, noise)
        both = noise(2)  # the bits of two calls, in the time of one
        return self._lengths(lengths, both[..., 0, :]), self._tensions(tensions, both[..., 1, :])

    def read_lengths(self, lengths: Floats, noise: Noise) -> Floats:
        """Readings of the encoders [m], with offset, noise and quantum."""
        sample = None if self._length_noise is None else noise(1)[..., 0, :]
        return self._lengths(lengths, sample)

    def read_tensions(self, tensions: Floats, noise: Noise) -> Floats:
        """Readings of the tension sensors [N], with offset and noise, never negative."""
        sample = None if self._tension_noise is None else noise(1)[..., 0, :]
        return self._tensions(tensions, sample)

    def _lengths(self, reading: Floats, noise: Floats | None) -> Floats:
        if self.length_offset is not None:
            reading = reading + self.length_offset
        if self._length_noise is not None:
            reading = reading + self._length_noise * noise
        if self._length_quantum is not None:
            reading = reading / self._length_quantum
            np.rint(reading, out=reading)
            reading *= self._length_quantum
        return reading

    def _tensions(self, tensions: Floats, noise: Floats | None) -> Floats:
        reading = tensions
        if self._tension_offset is not None:
            reading = reading + self._tension_offset
        if self._tension_noise is not None:
            reading = reading + self._tension_noise * noise
        return reading if reading is tensions else np.maximum(reading, self._none, out=reading)


def _of_each(values: Mapping[str, float], muscles: Sequence[str]) -> Floats | None:
    """Values by muscle as an array (m,), 0 by default; None if all are 0."""
    array = np.array([values.get(muscle, 0.0) for muscle in muscles])
    return array if array.any() else None
