"""A commissioning run through a driver: the robot is stopped after any error."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from jmm_agent.driving.commission import commission
from jmm_agent.driving.drive import LostReadingsError
from jmm_agent.driving.emergency_stop import EmergencyStop, EmergencyStopError
from jmm_agent.errors import AgentError
from jmm_agent.observation import SensorReadings
from tests.jmm_agent.commissioning.spring_robot import (
    LIMITS,
    MOTORS,
    MUSCLES,
    START,
    SpringRobot,
    nominal_map,
)


class LosingRobot(SpringRobot):
    """A robot some of whose readings are lost: each seventh, and from a step on all."""

    last = 10**9

    def read(self) -> SensorReadings:
        readings = super().read()
        lost = self._steps % 7 == 3 or self._steps > self.last
        return None if lost else readings  # type: ignore[return-value]


def agent(**changes: object) -> SimpleNamespace:
    """What a run needs of an agent."""
    kinematics = SimpleNamespace(limits=LIMITS)
    fields = {"motors": MOTORS, "order": None, "target": START, "kinematics": kinematics}
    return SimpleNamespace(**(fields | {"nominal_map": nominal_map()} | changes))


def test_lost_readings_are_bridged_and_faults_named() -> None:
    robot, seen = LosingRobot(0), list[float]()
    for order in (robot.commands, robot.lengths, robot.tensions):
        order[[7, 6]] = 6, 7
    result = commission(
        agent(), robot, held=robot.held,  # type: ignore[arg-type]
        watch=lambda readings, _: seen.append(readings.time),
    )  # fmt: skip
    assert [set(each.muscles) for each in result.findings] == [{MUSCLES[6], MUSCLES[7]}]
    assert robot.stopped == 0
    assert len(seen) > 100


def test_a_robot_that_falls_silent_is_stopped() -> None:
    robot = LosingRobot(0)
    robot.last = 50
    with pytest.raises(LostReadingsError, match="4 control periods"):
        commission(agent(), robot)  # type: ignore[arg-type]
    assert robot.stopped == 1


def test_an_emergency_stop_ends_the_run() -> None:
    robot, stop = SpringRobot(0), EmergencyStop()

    def watch(readings: SensorReadings, command: np.ndarray) -> None:
        if len(robot.written) == 30:
            stop.trigger("a person came near")

    with pytest.raises(EmergencyStopError, match="a person came near"):
        commission(agent(), robot, watch=watch, emergency_stop=stop)  # type: ignore[arg-type]
    assert robot.stopped == 1


def test_nothing_is_written_to_a_robot_with_an_impossible_length() -> None:
    robot = SpringRobot(0)
    robot.length_factors[3] = np.nan
    result = commission(agent(), robot)  # type: ignore[arg-type]
    assert [each.kind for each in result.findings] == ["encoder_dead"]
    assert robot.written == []


def test_motors_must_be_known_and_the_order_that_of_the_model() -> None:
    for changes, reason in (({"motors": None}, "Agent.motors"), ({"order": 1}, "earlier run")):
        robot = SpringRobot(0)
        with pytest.raises(AgentError, match=reason):
            commission(agent(**changes), robot)  # type: ignore[arg-type]
        assert robot.stopped == 1
        assert robot.written == []
