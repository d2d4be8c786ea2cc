"""Watch of tensions that stay at the motors' limit: something is wrong, and the motion must stop.

Muscles that pull against each other with all that their motors have tire tendons and heat motors.
A movement, or a map that has just been learned, brings a tension to its limit for a moment only.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jmm_agent.guard.faults import TENSION_LIMIT, Fault, MotorControl
from jmm_agent.observation import SensorReadings

AT_LIMIT = 0.95
"""Tension that counts as the limit, as a share of it [1]."""
LASTING = 5.0
"""How long a tension must have been there [s]."""


class TensionWatch:
    """Names tensions that stay at the limit.

    Args:
        muscles: names of the muscles.

    Attributes:
        faults: what was found in this episode, once for each muscle.
        newest: why the motion was stopped last, without a full stop; empty if it was not.
    """

    def __init__(self, muscles: Sequence[str]) -> None:
        self._muscles = muscles
        self.reset()

    def reset(self) -> None:
        """Forget all, as before a new episode."""
        self._at_limit = np.zeros(len(self._muscles))
        self.faults: list[Fault] = []
        self.newest = ""

    def update(self, readings: SensorReadings, passed: float, motors: MotorControl) -> bool:
        """Add the tensions of a control step.

        Args:
            readings: of the step.
            passed: its duration [s].
            motors: with the limit.

        Returns:
            Whether the motion must stop: a tension has been at its limit for long. The time begins
            anew then.
        """
        at_limit = readings.tensions >= AT_LIMIT * motors.limit
        self._at_limit = np.where(at_limit, self._at_limit + passed, 0.0)
        lasting = np.flatnonzero(self._at_limit >= LASTING).tolist()
        known = {fault.where for fault in self.faults}
        for muscle in lasting:
            name = self._muscles[muscle]
            self.newest = (
                f"{name} has pulled with {readings.tensions[muscle]:.3g} N of "
                f"{motors.limit:.3g} N for {LASTING:g} s: the arm is held where it is; check what "
                "it leans on, the wiring and the zero of the lengths, then move again"
            )
            if name not in known:
                self.faults.append(Fault(TENSION_LIMIT, name, readings.time, self.newest))
        if lasting:
            self._at_limit[:] = 0.0
        return bool(lasting)
