"""Trajectory through postures to a target."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jmm_agent.types import Floats


class Trajectory(NamedTuple):
    """Path through postures, at rest at both ends.

    Attributes:
        points: joint angles (K, n) [rad] to pass, K > 1, straight lines between them.
        start: time at the first point [s].
        duration: time from the first to the last point [s].
    """

    points: Floats
    start: float
    duration: float

    def at(self, time: float) -> Floats:
        """Joint angles (n,) [rad] at a time [s]."""
        position = self._position(time)
        first = min(int(position), len(self.points) - 2)
        before, after = self.points[first], self.points[first + 1]
        return before + (position - first) * (after - before)

    def remaining(self, time: float) -> float:
        """Number of points, with a fraction, that remain to be passed at a time [s]."""
        return len(self.points) - 1 - float(self._position(time))

    def _position(self, time: float) -> float:
        """Number of points, with a fraction, that were passed at a time [s]."""
        passed = 0.0 if time == self.start else time - self.start  # both infinite before the first
        share = np.clip(passed / self.duration, 0.0, 1.0) if self.duration else 1.0
        return share * share * (3.0 - 2.0 * share) * (len(self.points) - 1)

    def paused(self, pause: float) -> Trajectory:
        """The trajectory after a pause [s]: where it was, and as much of it to go."""
        return self._replace(start=self.start + pause)
