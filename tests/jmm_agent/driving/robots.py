"""Robots and agents of these tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np

from jmm_agent.agent import Agent
from jmm_agent.command_limits import CommandLimits
from jmm_agent.driving.drive import DriveReport, drive
from jmm_agent.errors import AgentError
from jmm_agent.guard.null_guard import NullGuard
from jmm_agent.muscles_in_use import MusclesInUse
from jmm_agent.observation import SensorReadings

PERIOD = 0.02
Distort = Callable[[SensorReadings], SensorReadings | None]


class Robot:
    """Counts calls; its clock begins at 1000 s.

    Args:
        distort: makes of the readings of some calls, counted from 1, what is returned instead.
    """

    def __init__(self, distort: dict[int, Distort] | None = None) -> None:
        self.time, self.commands, self.stopped = 1000.0, list[np.ndarray](), 0
        self.calls, self._distort = 0, distort or {}

    def read(self) -> SensorReadings | None:
        self.time += PERIOD
        self.calls += 1
        readings = SensorReadings(self.time, np.full(2, self.time), np.zeros(2))
        return self._distort.get(self.calls, lambda same: same)(readings)

    def write(self, target_lengths: np.ndarray) -> None:
        assert np.isfinite(target_lengths).all()
        self.commands.append(target_lengths)

    def stop(self) -> None:
        self.stopped += 1


class EchoAgent:
    """Commands the measured lengths plus 1; raises after a time [s]."""

    def __init__(self, raises_at: float = np.inf, command: Sequence[float] | None = None) -> None:
        self.raises_at, self._command = raises_at, command
        self.guard, self.limits = NullGuard(), CommandLimits()
        self.in_use = MusclesInUse(("m0", "m1"))
        self.stiffness: np.ndarray | None = None

    def step(self, readings: SensorReadings) -> np.ndarray:
        if readings.time > self.raises_at:
            raise AgentError("Agent: lengths must be finite.")
        return readings.lengths + 1.0 if self._command is None else np.array(self._command)


def driven(agent: EchoAgent, robot: Any, seconds: float = 0.1, **more: Any) -> DriveReport:
    return drive(cast(Agent, agent), robot, seconds, **more)
