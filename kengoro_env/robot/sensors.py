"""Sensors: what encoders and tension sensors make of the truth, of one robot or of many at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from kengoro_env.robot.draft import SensorErrors
from kengoro_env.types import Floats

Noise = Callable[[int], Floats]
"""Standard normal noise (k, m) of as many kinds of sensors as asked for, one after the other."""


class Sensors:
    """Encoders and tension sensors of wires.

    Lengths and tensions are (m,), or (count, m) of many robots. Where a sensor reads the truth, it
    gives back the array that it was given.

    Args:
        senses: how they depart from the truth.
        muscles: names of the wires.

    Attributes:
        length_offset: of the encoders (m,) [m]; None for none.
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
        """How many kinds of sensors have noise."""
        return sum(noise is not None for noise in (self._length_noise, self._tension_noise))

    def layout(self) -> dict[str, Floats | None]:
        """Arrays (m,) by their names in control_step.c; None where a sensor reads the truth."""
        return {
            "length_offset": self.length_offset,
            "length_noise": self._length_noise,
            "length_quantum": self._length_quantum,
            "tension_offset": self._tension_offset,
            "tension_noise": self._tension_noise,
        }

    def read(self, lengths: Floats, tensions: Floats, noise: Noise) -> tuple[Floats, Floats]:
        """What both read [m], [N]: the same as lengths first, then tensions."""
        if self._length_noise is None or self._tension_noise is None:
            return self.read_lengths(lengths, noise), self.read_tensions(tensions, noise)
        both = noise(2)  # the bits of two calls, in the time of one
        return self._lengths(lengths, both[..., 0, :]), self._tensions(tensions, both[..., 1, :])

    def read_lengths(self, lengths: Floats, noise: Noise) -> Floats:
        """What encoders read [m]: with offset, noise and quantum."""
        drawn = None if self._length_noise is None else noise(1)[..., 0, :]
        return self._lengths(lengths, drawn)

    def read_tensions(self, tensions: Floats, noise: Noise) -> Floats:
        """What tension sensors read [N]: with offset and noise, never negative."""
        drawn = None if self._tension_noise is None else noise(1)[..., 0, :]
        return self._tensions(tensions, drawn)

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
    """The value of each muscle (m,), 0 where none is given; None where all are 0."""
    array = np.array([values.get(muscle, 0.0) for muscle in muscles])
    return array if array.any() else None
