"""What a robot tells the agent."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats


class SensorReadings(NamedTuple):
    """What the robot feels and sees at one moment; nothing else reaches the agent.

    Attributes:
        time: now [s].
        lengths: measured muscle lengths (m,) [m].
        tensions: measured muscle tensions (m,) [N].
        frame: newest camera frame (H, W, 3) uint8, or None.
        frame_time: when that frame was taken [s].
    """

    time: float
    lengths: Floats
    tensions: Floats
    frame: np.ndarray | None = None
    frame_time: float = -np.inf

    def checked(self, after: float, muscles: int, guarded: bool) -> SensorReadings:
        """The same with copies of the numbers, which may be kept.

        Args:
            after: time of the senses before [s].
            muscles: number of lengths and of tensions.
            guarded: whether a guard takes care of what is not finite, as long as one length is.

        Raises:
            AgentError: they are of the wrong shape, not finite, or not later.
        """
        lengths = _numbers("lengths", self.lengths, muscles, 1 if guarded else muscles)
        tensions = _numbers("tensions", self.tensions, muscles, 0 if guarded else muscles)
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
