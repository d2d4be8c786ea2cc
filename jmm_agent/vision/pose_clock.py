"""Clock of a tracker: whether its time stamps fit the motion by the muscle lengths.

A tracker that stamps its poses by a clock of its own pairs them with muscle lengths of another
time. The offset is estimated from movements as the delay of a camera is (`DelayEstimator`), but of
either sign, because each movement ends at rest. The newest movements alone count, so that a clock
that is set right or wrong later is noticed.
"""

from __future__ import annotations

import numpy as np

from jmm_agent.types import Floats
from jmm_agent.vision.camera_delay import DelayEstimator

LARGEST = 2.0
"""Largest offset that is compared, of either sign [s]."""
STEP = 0.05
"""Distance of the offsets that are compared [s]."""
TOLERATED = 0.1
"""Offset that is not named [s]; the lengths at rest are the same over more time."""
DEVIATIONS = 3.0
"""Standard deviations by which an offset must be larger than that [1]."""
APART = 0.08
"""Least time between two poses that are compared [s]."""


class PoseClock:
    """Compares when a hand moves by measured poses and by the muscle lengths.

    Args:
        noise: standard deviation of a position [m].
    """

    def __init__(self, noise: float) -> None:
        self._estimator = DelayEstimator(LARGEST, noise, LARGEST, STEP)
        self._newest = -np.inf

    def reset(self) -> None:
        """Forget the present movement, but not what was found from earlier ones."""
        self._estimator.reset()
        self._newest = -np.inf

    def add(self, time: float, position: Floats) -> None:
        """Add a measured position; one soon after another is left out.

        Args:
            time: of the measurement, by its stamp [s].
            position: (3,) [m].
        """
        if time >= self._newest + APART:
            self._newest = time
            self._estimator.add_frame(time, position)

    def expect(self, time: float, position: Floats) -> None:
        """Add where the hand is expected by the muscle lengths.

        Args:
            time: of the control step [s].
            position: (3,) [m].
        """
        self._estimator.expect(time, position)

    def end_movement(self) -> None:
        """Evaluate the last movement, when the hand has come to rest."""
        self._estimator.end_movement()

    def problem(self) -> str:
        """By how much the stamps are wrong, in a sentence; empty if they are right or unknown."""
        found = self._estimator.estimate
        if found.reason or abs(found.delay) <= TOLERATED + DEVIATIONS * found.std:
            return ""
        how = "late" if found.delay > 0.0 else "early"
        return (
            "by the motion of the muscles the times of the measured poses are "
            f"{abs(found.delay):.2f} s too {how}; give the time of the measurement, on the clock "
            "of the readings"
        )
