"""The loop between an agent and the robot that it drives."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jmm_agent.command_limits import CommandLimits
from jmm_agent.driving.drive import DriveOptions
from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import MotorControl
from jmm_agent.observation import SensorReadings
from tests.jmm_agent.driving.robots import EchoAgent, Robot, driven
from tests.jmm_agent.small_map import LIMITS, make_map


def test_every_reading_is_answered_for_as_long_as_asked() -> None:
    robot, seen = Robot(), list[float]()

    report = driven(EchoAgent(), robot, watch=lambda readings, targets: seen.append(readings.time))

    assert seen == pytest.approx(1000.02 + 0.02 * np.arange(6))
    np.testing.assert_array_equal([c[0] - 1.0 for c in robot.commands], seen)
    assert robot.stopped == 0
    assert (report.cycles, report.lost, report.gaps) == (6, 0, 0)


def test_it_goes_on_where_it_was() -> None:
    robot = Robot()

    driven(EchoAgent(), robot)
    driven(EchoAgent(), robot)

    assert len(robot.commands) == 12


@pytest.mark.parametrize("seconds", [np.nan, np.inf, -1.0])
def test_a_duration_that_never_ends_is_refused(seconds: float) -> None:
    robot = Robot()
    with pytest.raises(AgentError, match="must be finite and not negative"):
        driven(EchoAgent(), robot, seconds)
    assert (robot.commands, robot.stopped) == ([], 1)


@pytest.mark.parametrize("command", [[np.nan, 0.0], [0.0, -np.inf]])
def test_commands_that_are_not_finite_never_reach_the_robot(command: list[float]) -> None:
    robot = Robot()
    with pytest.raises(AgentError, match="not finite"):
        driven(EchoAgent(command=command), robot)
    assert (robot.commands, robot.stopped) == ([], 1)


def test_a_driver_that_can_pause_is_paused() -> None:
    class Pausing(Robot):
        paused = 0

        def pause(self) -> None:
            self.paused += 1

    robot = Pausing()
    driven(EchoAgent(), robot)
    assert (robot.paused, robot.stopped) == (1, 0)
    with pytest.raises(AgentError):
        driven(EchoAgent(raises_at=0.0), robot)
    assert (robot.paused, robot.stopped) == (1, 1)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("timeout", np.nan),
        ("timeout", 0.0),
        ("lost", 0),
        ("lost", 1.5),
        ("lost", np.nan),
        ("lost", np.inf),
    ],
)
def test_options_that_mean_nothing_are_refused(name: str, value: float) -> None:
    with pytest.raises(AgentError, match=name):
        DriveOptions(**{name: value})  # type: ignore[arg-type]


def test_a_thread_may_drive() -> None:
    robot = Robot()
    thread = threading.Thread(target=driven, args=(EchoAgent(), robot))
    thread.start()
    thread.join()
    assert len(robot.commands) == 6


def test_limits_derive_from_the_robot_for_the_duration_of_a_drive() -> None:
    agent, motors, found = EchoAgent(), MotorControl(1000.0, 3.0, 60.0), list[Any]()
    more: Any = agent
    more.limits, more.map, more.motors = None, make_map(), motors
    more.kinematics = SimpleNamespace(limits=LIMITS)

    driven(agent, Robot(), watch=lambda *_: found.append(agent.limits))

    expected = CommandLimits.of(more.map, LIMITS, motors)
    assert found[0].motors == motors
    np.testing.assert_array_equal(found[0].rate, expected.rate)
    assert more.limits is None
    given = CommandLimits(0.1)
    driven(
        agent,
        Robot(),
        watch=lambda *_: found.append(agent.limits),
        options=DriveOptions(limits=given),
    )
    assert found[-1] is given


@pytest.mark.parametrize("missing", ["read", "write", "stop"])
def test_a_driver_without_one_of_its_methods_is_refused_before_it_is_used(missing: str) -> None:
    robot: Any = Robot()
    setattr(robot, missing, None)
    with pytest.raises(AgentError, match=f"Robot lacks the method {missing}; a driver has read"):
        driven(EchoAgent(), robot)
    assert (robot.calls, robot.commands) == (0, [])
    assert robot.stopped == (missing != "stop")


class SoftRobot(Robot):
    """A robot whose stiffness can be changed; it notes which commands came before each change."""

    def __init__(self) -> None:
        super().__init__()
        self.stiffness: list[tuple[int, float]] = []

    def set_stiffness(self, stiffness: np.ndarray) -> None:
        self.stiffness.append((len(self.commands), float(stiffness[0])))


class SofteningAgent(EchoAgent):
    """Demands another stiffness from its third step on, and another one from its fifth."""

    steps = 0

    def step(self, readings: SensorReadings) -> np.ndarray:
        self.steps += 1
        if self.steps in (3, 5):
            self.stiffness = np.full(2, 1000.0 * self.steps)
        return super().step(readings)


def test_a_stiffness_is_written_with_the_command_that_belongs_to_it_and_once() -> None:
    agent, robot = SofteningAgent(), SoftRobot()
    driven(agent, robot)
    assert len(robot.commands) == 6
    assert robot.stiffness == [(2, 3000.0), (4, 5000.0)]
    driven(agent, robot)  # the robot may have been restarted since
    assert robot.stiffness[2:] == [(6, 5000.0)]


def test_a_stiffness_that_a_driver_cannot_set_stops_the_robot() -> None:
    agent, robot = SofteningAgent(), Robot()
    with pytest.raises(AgentError, match="driver Robot has no method set_stiffness"):
        driven(agent, robot)
    assert (len(robot.commands), robot.stopped) == (2, 1)
