"""Detects gaps in a sequence of time stamps, in which a motion must not go on."""

from __future__ import annotations

from collections import deque
from statistics import median

from jmm_agent.observation import CONTROL_PERIOD

PERIODS = 5.0
"""A step of more than this many typical steps is a gap."""
RECENT = 9
"""Number of newest steps whose median is the typical one; single late cycles do not change it."""


class GapDetector:
    """Compares each step of time with the typical one, for a clock of any period.

    Attributes:
        period: typical step [s]; the `CONTROL_PERIOD` before there is any.
    """

    def __init__(self) -> None:
        self._last: float | None = None
        self._steps: deque[float] = deque(maxlen=RECENT)
        self.period = CONTROL_PERIOD

    @property
    def shortest(self) -> float:
        """Shortest of the newest steps [s]; 0 before the second one, because one may be a gap."""
        return min(self._steps) if len(self._steps) > 1 else 0.0

    def update(self, time: float) -> float:
        """Add a time stamp.

        Args:
            time: of the newest readings [s].

        Returns:
            What the step is longer than a typical one [s]: 0 unless it is a gap, negative if the
            clock did not go on.
        """
        last, self._last = self._last, time
        if last is None:
            return 0.0
        step = time - last
        if step <= 0.0:
            return step - self.period
        excess = step - self.period if step > PERIODS * self.period else 0.0
        self._steps.append(step)
        self.period = median(self._steps)
        return excess
