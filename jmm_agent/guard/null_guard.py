"""Guard that watches nothing: all readings are believed, all commands are passed on."""

from __future__ import annotations

import numpy as np

from jmm_agent.guard.arm_state import ArmState
from jmm_agent.guard.faults import Fault
from jmm_agent.guard.muscle_monitor import FilteredReadings
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Bools, Floats


class NullGuard:
    """Stands in for a `Guard` in an agent without one: passes everything through.

    Attributes:
        take_back: 0 s; nothing is ever unlearned.
    """

    take_back = 0.0

    @property
    def faults(self) -> list[Fault]:
        """Always empty."""
        return []

    def reset(self) -> None:
        """Do nothing."""

    def map_changed(self) -> None:
        """Do nothing."""

    def jump(self) -> None:
        """Do nothing."""

    def set_stiffness(self, stiffness: Floats) -> None:
        """Do nothing."""

    def leave_out(self, muscles: Bools) -> None:
        """Do nothing."""

    def filter(
        self, readings: SensorReadings, after: float, command: Floats, expected: Floats
    ) -> FilteredReadings:
        """Copies of the readings, none of them in doubt.

        Args:
            readings: of this control step.
            after: time of the readings before [s]; -inf for the first.
            command: target lengths (m,) [m] while they were measured.
            expected: muscle lengths (m,) [m] by the map at the estimate; not used.

        Raises:
            AgentError: the readings are of the wrong shape, not finite or not later.
        """
        checked = readings.checked(after, len(command))
        none = np.zeros(len(command), dtype=bool)
        return FilteredReadings(checked.lengths, checked.tensions, none, none, none)

    def watch(self, readings: SensorReadings, state: ArmState) -> bool:
        """Return False: no fault is ever noticed."""
        return False

    def limit(self, target_lengths: Floats) -> Floats:
        """Return the target lengths (m,) [m] as they are."""
        return target_lengths
