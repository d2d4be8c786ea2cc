"""Logs of an agent, repeated to the bit."""

from __future__ import annotations

from time import sleep
from typing import Any, cast

import numpy as np

from jmm_agent.agent import Agent
from jmm_agent.agent_log import RecordedAgent
from jmm_agent.command_limits import CommandLimits
from jmm_agent.driving.drive import DriveOptions, drive
from jmm_agent.learning.options import AS_SOON
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats
from tests.jmm_agent.learning.resting import (
    STEPS,
    THIRD,
    Make,
    learned,
    readings,
)


def test_the_log_of_a_live_run_is_repeated_to_the_bit(
    make: Make, nominal_map: JointMuscleMap
) -> None:
    live, repeated = make("process", AS_SOON), make("step", AS_SOON)
    recorded: Any = RecordedAgent(live)
    commands = []
    for k in range(2 * STEPS):
        if k == STEPS:
            recorded.go(THIRD, 0.5)
        commands.append(recorded.step(readings(nominal_map, k, 1 + k // STEPS)))
        while k % STEPS > STEPS - 9 and live._schedule.late:
            sleep(0.01)  # the steps of this test are shorter than those of a robot
    recorded.finish_learning()
    assert live.vision.fired == 2
    np.testing.assert_array_equal(commands, recorded.log.replay(repeated))
    assert learned(live) == learned(repeated)
    assert live.entered == repeated.entered


class Resting:
    """Driver of a robot that rests at one posture."""

    def __init__(self, nominal_map: JointMuscleMap) -> None:
        self._map, self._steps = nominal_map, 0

    def read(self) -> SensorReadings:
        self._steps += 1
        return readings(self._map, self._steps, 1)

    def write(self, target_lengths: Floats) -> None:
        """Do nothing."""

    def stop(self) -> None:
        """Do nothing."""


def test_the_log_of_a_drive_after_a_power_cycle_is_repeated_to_the_bit(
    make: Make, nominal_map: JointMuscleMap
) -> None:
    recorded: Any = RecordedAgent(make())
    commands, limits = list[Floats](), CommandLimits(0.01)
    recorded.zeroed()
    recorded.go(THIRD, 0.2)
    robot, options = Resting(nominal_map), DriveOptions(limits=limits)
    drive(recorded, robot, 0.4, lambda _, command: commands.append(command), options)
    repeated = make()
    np.testing.assert_array_equal(commands, recorded.log.replay(repeated))
    assert [call.method for call in recorded.log.calls[:2]] == ["zeroed", "go"]


class IdleAgent:
    """Commands nothing."""

    learning = hand_is_free = True
    limits, entered = None, ()

    def step(self, readings: SensorReadings) -> Floats:
        return np.zeros(2)


def test_a_driver_may_use_its_memory_again_after_a_step() -> None:
    recorded: Any = RecordedAgent(cast(Agent, IdleAgent()))
    lengths, frame = np.zeros(2), np.zeros((2, 2, 3), np.uint8)
    for time in (0.0, 0.02):
        recorded.step(SensorReadings(time, lengths, np.zeros(2), frame, time))
        lengths += 1.0
        frame += 1
    first, second = (call.arguments[0] for call in recorded.log.calls)
    assert (first.lengths.max(), second.lengths.max()) == (0.0, 1.0)
    assert (first.frame.max(), second.frame.max()) == (0, 1)
