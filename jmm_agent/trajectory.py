"""The way through postures to a target."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jmm_agent.types import Floats


class Trajectory(NamedTuple):
    """Joint angles (K, n) [rad] to pass, evenly in time from ``start`` [s] for ``duration`` [s]."""

    points: Floats
    start: float
    duration: float

    def at(self, time: float) -> Floats:
        """Joint angles (n,) [rad] at a time [s]: at rest at both ends."""
        share = np.clip((time - self.start) / self.duration, 0.0, 1.0) if self.duration else 1.0
        place = share * share * (3.0 - 2.0 * share) * (len(self.points) - 1)
        first = min(int(place), len(self.points) - 2)
        return self.points[first] + (place - first) * (self.points[first + 1] - self.points[first])
