"""Lost readings and time stamps of a drive."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from jmm_agent.driving.drive import DriveOptions, LostReadingsError
from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import STAMPS_SKIPPED
from jmm_agent.observation import SensorReadings
from jmm_agent.time_line import TimeLine, TimeLineOptions
from tests.jmm_agent.driving.robots import PERIOD, Distort, EchoAgent, Robot, driven


def nothing(readings: SensorReadings) -> None:
    """A lost packet."""


LOSSES: dict[str, Distort] = {
    "no readings came": nothing,
    "no length is finite": lambda r: r._replace(lengths=np.full(2, np.nan)),
    "a length is not finite": lambda r: r._replace(lengths=np.array([np.nan, 1.0])),
    "a tension is not finite": lambda r: r._replace(tensions=np.array([np.nan, 1.0])),
    "time is not finite": lambda r: r._replace(time=np.nan),
    "time is that of the readings before": lambda r: r._replace(time=1000.06),
}


@pytest.mark.parametrize("reason", LOSSES)
def test_cycles_without_usable_readings_hold_the_last_command(reason: str) -> None:
    robot = Robot({4: LOSSES[reason], 5: LOSSES[reason]})

    report = driven(EchoAgent(), robot, 0.2)

    assert report.lost == 2
    assert reason in report.reasons[0][0]
    assert report.reasons[0][1] == 2
    assert len(robot.commands) == report.cycles + report.lost
    for held in robot.commands[3:5]:
        np.testing.assert_array_equal(held, robot.commands[2])
    assert robot.stopped == 0


def test_a_guard_takes_readings_of_which_some_are_not_finite() -> None:
    agent: Any = EchoAgent(command=[0.0, 0.0])
    agent.guard = object()
    robot = Robot({4: LOSSES["a length is not finite"], 5: LOSSES["a tension is not finite"]})
    assert driven(agent, robot).lost == 0
    assert driven(agent, Robot({4: LOSSES["no length is finite"]})).lost == 1


@pytest.mark.parametrize("name", ["lengths", "tensions"])
def test_readings_that_are_no_numbers_are_refused_with_a_guard(name: str) -> None:
    agent: Any = EchoAgent()
    agent.guard = object()
    robot = Robot({4: lambda readings: readings._replace(**{name: ["high", "low"]})})
    with pytest.raises(AgentError, match=f"readings with {name} that are no numbers"):
        driven(agent, robot)
    assert robot.stopped == 1


@pytest.mark.parametrize("reason", LOSSES)
@pytest.mark.parametrize("tolerated", [1, 5])
def test_too_many_of_them_stop_the_robot(reason: str, tolerated: int) -> None:
    robot = Robot(dict.fromkeys(range(4, 100), LOSSES[reason]))
    with pytest.raises(LostReadingsError, match=reason):
        driven(EchoAgent(), robot, 10.0, options=DriveOptions(lost=tolerated))
    assert robot.stopped == 1
    assert robot.calls == 3 + tolerated


def test_nothing_is_commanded_before_the_first_readings() -> None:
    robot = Robot({1: nothing, 2: nothing})
    driven(EchoAgent(), robot)
    assert len(robot.commands) == 6


def test_a_gap_does_not_count_as_time_that_was_driven() -> None:
    robot = Robot()

    def watch(readings: SensorReadings, targets: np.ndarray) -> None:
        if len(robot.commands) == 5:
            robot.time += 10.0

    report = driven(EchoAgent(), robot, 0.4, watch=watch)
    assert (report.cycles, report.gaps) == (21, 1)
    assert report.longest_gap == pytest.approx(10.0)


class TooLarge(Robot):
    """Its time stamps are not in seconds."""

    def __init__(self, unit: float) -> None:
        super().__init__()
        self._unit = unit

    def read(self) -> SensorReadings | None:
        readings = super().read()
        assert readings is not None
        return readings._replace(time=readings.time * self._unit)


@pytest.mark.parametrize("unit", [1e3, 1e6, 1e9])
def test_stamps_that_are_not_in_seconds_end_the_drive_with_a_sentence(unit: float) -> None:
    robot = TooLarge(unit)
    with pytest.raises(AgentError, match="in seconds, not in ms, us or ns"):
        driven(EchoAgent(), robot, 2.0)
    assert robot.stopped == 1
    assert len(robot.commands) <= 2


def test_a_pause_before_the_second_readings_is_a_gap() -> None:
    robot = Robot()

    def watch(readings: SensorReadings, targets: np.ndarray) -> None:
        if len(robot.commands) == 1:
            robot.time += 10.0

    assert driven(EchoAgent(), robot, 0.4, watch=watch).gaps == 1


@pytest.mark.parametrize("jump", [-3600.0, -0.05])
def test_a_clock_that_is_set_back_ends_no_drive(jump: float) -> None:
    robot = Robot()

    def watch(readings: SensorReadings, targets: np.ndarray) -> None:
        if len(robot.commands) == 5:
            robot.time += jump

    assert driven(EchoAgent(), robot, 0.4, watch=watch).cycles == 21
    assert robot.stopped == 0


def test_a_clock_that_is_set_after_the_first_readings_ends_no_drive() -> None:
    """As that of a board without a battery, once it has the time of the network."""
    robot = Robot()

    def watch(readings: SensorReadings, targets: np.ndarray) -> None:
        if len(robot.commands) == 1:
            robot.time += 1.7e9

    assert driven(EchoAgent(), robot, 0.4, watch=watch).gaps == 1
    assert robot.stopped == 0


@pytest.mark.parametrize("seconds", [0.02, 0.26])
def test_a_drive_lasts_as_long_on_a_clock_that_counts_from_1970(seconds: float) -> None:
    class Epoch(Robot):
        def read(self) -> SensorReadings | None:
            readings = super().read()
            assert readings is not None
            return readings._replace(time=1.7e9 + PERIOD * self.calls)

    cycles = round(seconds / PERIOD) + 1
    assert driven(EchoAgent(), Robot(), seconds).cycles == cycles
    assert driven(EchoAgent(), Epoch(), seconds).cycles == cycles


class ClockedAgent(EchoAgent):
    """Skips time stamps as an agent does."""

    def __init__(self) -> None:
        super().__init__()
        self.line = TimeLine(TimeLineOptions())

    def step(self, readings: SensorReadings) -> np.ndarray:
        tick = self.line.tick(readings.time)
        if tick is None:
            return np.zeros(2)
        self.line.accept(tick)
        return super().step(readings)


class TwiceEach(Robot):
    """Its driver returns the same readings twice."""

    def read(self) -> SensorReadings | None:
        if self.calls % 2:
            self.time -= PERIOD
        return super().read()


def test_the_agent_names_repeated_stamps_and_they_are_logged_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    agent, robot = ClockedAgent(), TwiceEach()
    report = driven(agent, robot, 1.2)
    assert report.lost == agent.line.skipped >= 30
    assert [fault.kind for fault in agent.line.found()] == [STAMPS_SKIPPED]
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    assert "that of the readings before" in caplog.text
    for new, held in zip(robot.commands[::2], robot.commands[1::2], strict=False):
        np.testing.assert_array_equal(held, new)


def test_losses_far_apart_are_logged_each(caplog: pytest.LogCaptureFixture) -> None:
    robot = Robot(dict.fromkeys((10, 11, 13, 100), nothing))
    assert driven(EchoAgent(), robot, 2.5).lost == 4
    assert len(caplog.records) == 2


WRONG: dict[str, Callable[[SensorReadings], Any]] = {
    "an object of type tuple; it must return SensorReadings": lambda r: (r.time, r.lengths),
    "the time '1000.1'; it must be a number in seconds": lambda r: r._replace(time="1000.1"),
    "the time None; it must": lambda r: r._replace(time=None),
    "lengths that are no numbers": lambda r: r._replace(lengths=["a", "b"]),
    "tensions that are no numbers": lambda r: r._replace(tensions={"a": 1.0}),
}


@pytest.mark.parametrize("sentence", WRONG)
def test_what_are_no_readings_ends_the_drive_in_a_sentence(sentence: str) -> None:
    robot = Robot({4: WRONG[sentence]})
    with pytest.raises(AgentError, match=sentence):
        driven(EchoAgent(), robot)
    assert robot.stopped == 1
