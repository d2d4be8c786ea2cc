"""Sensor readings of one control step, the only data that reach the agent."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats

CONTROL_PERIOD = 0.02
"""Time between two control steps [s], assumed where there are no earlier readings."""


class SensorReadings(NamedTuple):
    """Sensor readings of the robot at one moment.

    Attributes:
        time: time of the readings [s].
        lengths: measured muscle lengths (m,) [m].
        tensions: measured muscle tensions (m,) [N].
        frame: newest camera frame (H, W, 3) uint8, or None.
        frame_time: time at which that frame was taken [s]; or arrived, with a delay in the agent's
            `CameraClock`.
        joint_angles: measured joint angles (n,) [rad], NaN for a joint without encoder; None if no
            joint has one.
        temperatures: measured temperatures of the motors' housings (m,) [degC], NaN for a motor
            without sensor; None if no motor has one.
    """

    time: float
    lengths: Floats
    tensions: Floats
    frame: np.ndarray | None = None
    frame_time: float = -np.inf
    joint_angles: Floats | None = None
    temperatures: Floats | None = None

    def checked(self, after: float, muscles: int, gaps: bool = False) -> SensorReadings:
        """The readings with copies of lengths and tensions.

        Args:
            after: time of the readings before [s]; these must be later.
            muscles: number of lengths and of tensions, m.
            gaps: whether lengths and tensions may be not finite, but for one length.

        Raises:
            AgentError: the readings are of the wrong shape, not finite or not later.
        """
        lengths = _numbers("lengths", self.lengths, muscles, 1 if gaps else muscles)
        tensions = _numbers("tensions", self.tensions, muscles, 0 if gaps else muscles)
        if not (np.isfinite(self.time) and self.time > after):
            raise AgentError(
                f"Agent: time must be finite and later than {after} s, got {self.time} s."
            )
        return self._replace(lengths=lengths, tensions=tensions)


def _numbers(name: str, value: Floats, count: int, needed: int) -> Floats:
    """A copy of ``count`` numbers, of which at least ``needed`` must be finite."""
    array = np.array(value, dtype=float)
    if array.shape != (count,) or np.isfinite(array).sum() < needed:
        raise AgentError(
            f"Agent: {name} must be finite and of shape {(count,)}, got shape {array.shape}."
        )
    return array
