"""Transition from one map to the next: commands move there at a limited speed.

What is learned from an observation may change all lengths by centimetres. A command that jumped
there would jerk the arm, with a largest tension that has nothing to do with either posture.
"""

from __future__ import annotations

import numpy as np

from jmm_agent.types import Floats, Ints


class MapTransition:
    """By how much commands still differ from those of the present map.

    All muscles arrive together, so that the arm moves straight from one posture to the other.

    Args:
        muscles: number of muscles, m.
        rate: largest speed of a muscle's command on the way [m/s]; infinite to jump.
    """

    def __init__(self, muscles: int, rate: float) -> None:
        self._rate = rate
        self._left, self._time = np.zeros(muscles), 0.0

    def reset(self) -> None:
        """Be at the present map."""
        self._left, self._time = np.zeros_like(self._left), 0.0

    def begin(self, change: Floats) -> None:
        """Begin a transition; what is left of an earlier one is part of it.

        Args:
            change: lengths by the new map minus those by the old one (m,) [m].
        """
        self._left = self._left - change
        self._time = float(np.abs(self._left).max()) / self._rate
        if self._time == 0.0:
            self.reset()

    def reorder(self, order: Ints) -> None:
        """Continue with muscles in another order: ``order`` (m,) is where each was before."""
        self._left = self._left[order]

    def advance(self, passed: float) -> Floats:
        """Lengths to add to those of the present map (m,) [m].

        Args:
            passed: time since the last call [s].
        """
        if self._time > 0.0:
            self._left = self._left * max(0.0, 1.0 - passed / self._time)
            self._time = max(0.0, self._time - passed)
        return self._left
