"""The loop between an agent and the robot that it drives."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jmm_agent.command_limits import CommandLimits
from jmm_agent.driving.call_watch import DriverTimeoutError
from jmm_agent.driving.drive import DriveOptions, LostReadingsError
from jmm_agent.driving.emergency_stop import EmergencyStop, EmergencyStopError
from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import MotorControl
from jmm_agent.observation import SensorReadings
from tests.jmm_agent.driving.robots import Distort, EchoAgent, Robot, driven
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


@pytest.mark.parametrize("by", ["agent", "watcher"])
def test_the_robot_is_stopped_when_anything_goes_wrong(by: str) -> None:
    robot = Robot()
    agent = EchoAgent(raises_at=1000.07 if by == "agent" else np.inf)

    def watch(readings: SensorReadings, targets: np.ndarray) -> None:
        if by == "watcher" and readings.time > 1000.07:
            raise KeyboardInterrupt

    with pytest.raises((AgentError, KeyboardInterrupt)):
        driven(agent, robot, watch=watch)

    assert robot.stopped == 1


@pytest.mark.parametrize("seconds", [np.nan, np.inf, -1.0])
def test_a_duration_that_never_ends_is_refused(seconds: float) -> None:
    robot = Robot()
    with pytest.raises(AgentError, match="must be finite and not negative"):
        driven(EchoAgent(), robot, seconds)
    assert (robot.commands, robot.stopped) == ([], 1)


def test_a_failure_to_stop_does_not_hide_the_first_error() -> None:
    class Broken(Robot):
        def stop(self) -> None:
            super().stop()
            raise OSError("the line is down")

    robot = Broken()
    with pytest.raises(AgentError, match="lengths must be finite") as raised:
        driven(EchoAgent(raises_at=1000.07), robot)
    assert "the line is down" in raised.value.__notes__[0]
    assert robot.stopped == 1


@pytest.mark.parametrize("command", [[np.nan, 0.0], [0.0, -np.inf]])
def test_commands_that_are_not_finite_never_reach_the_robot(command: list[float]) -> None:
    robot = Robot()
    with pytest.raises(AgentError, match="not finite"):
        driven(EchoAgent(command=command), robot)
    assert (robot.commands, robot.stopped) == ([], 1)


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


@pytest.mark.parametrize("method", ["read", "write"])
def test_a_call_that_hangs_is_interrupted(method: str) -> None:
    class Hanging(Robot):
        def read(self) -> SensorReadings | None:
            if method == "read" and self.calls == 3:
                time.sleep(60.0)
            return super().read()

        def write(self, target_lengths: np.ndarray) -> None:
            if method == "write":
                time.sleep(60.0)

    robot, begin = Hanging(), time.monotonic()
    with pytest.raises(DriverTimeoutError, match=f"{method} has not returned within 0.1 s"):
        driven(EchoAgent(), robot, options=DriveOptions(timeout=0.1))
    assert time.monotonic() - begin < 5.0
    assert robot.stopped == 1
    assert signal.getsignal(signal.SIGALRM) is signal.SIG_DFL


def test_the_robot_is_stopped_although_a_call_cannot_be_interrupted() -> None:
    """In a thread, where Python gets no signals: `stop` lets the call return."""

    class Hanging(Robot):
        released = threading.Event()

        def read(self) -> SensorReadings | None:
            if self.calls == 3:
                self.released.wait(60.0)
            return super().read()

        def stop(self) -> None:
            super().stop()
            self.released.set()

    robot, errors = Hanging(), list[BaseException]()

    def target() -> None:
        try:
            driven(EchoAgent(), robot, options=DriveOptions(timeout=0.1))
        except DriverTimeoutError as error:
            errors.append(error)

    thread = threading.Thread(target=target)
    thread.start()
    thread.join(10.0)
    assert len(errors) == 1
    assert robot.stopped == 1


def test_an_emergency_stop_stays_until_it_is_reset() -> None:
    robot, emergency = Robot(), EmergencyStop()

    def watch(readings: SensorReadings, targets: np.ndarray) -> None:
        if len(robot.commands) == 3:
            threading.Thread(target=emergency.trigger, args=("a hand is in the way",)).start()
            time.sleep(0.1)

    for _ in range(2):
        with pytest.raises(EmergencyStopError, match="a hand is in the way"):
            driven(EchoAgent(), robot, watch=watch, emergency_stop=emergency)
    assert (len(robot.commands), robot.stopped) == (3, 2)
    emergency.reset()
    driven(EchoAgent(), robot, emergency_stop=emergency)
    assert len(robot.commands) == 9


def test_an_emergency_stop_ends_a_call_that_waits() -> None:
    class Waiting(Robot):
        def read(self) -> SensorReadings | None:
            if self.calls == 3:
                threading.Timer(0.1, emergency.trigger).start()
                time.sleep(60.0)
            return super().read()

    robot, emergency, begin = Waiting(), EmergencyStop(), time.monotonic()
    with pytest.raises(EmergencyStopError):
        driven(EchoAgent(), robot, emergency_stop=emergency)
    assert time.monotonic() - begin < 5.0
    assert robot.stopped == 1


def test_an_interrupted_drive_stays_stopped() -> None:
    robot, emergency = Robot(), EmergencyStop()

    def watch(*_: Any) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        driven(EchoAgent(), robot, watch=watch, emergency_stop=emergency)
    with pytest.raises(EmergencyStopError, match="interrupted"):
        driven(EchoAgent(), robot, emergency_stop=emergency)
    assert len(robot.commands) == 1


def test_a_second_interruption_does_not_keep_the_robot_from_stopping() -> None:
    class Interrupted(Robot):
        def stop(self) -> None:
            super().stop()
            if self.stopped == 1:
                raise KeyboardInterrupt

    robot = Interrupted()
    with pytest.raises(AgentError, match="lengths must be finite"):
        driven(EchoAgent(raises_at=1000.07), robot)
    assert robot.stopped == 2


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


@pytest.mark.parametrize(("name", "value"), [("timeout", np.nan), ("timeout", 0.0), ("lost", 0)])
def test_options_that_mean_nothing_are_refused(name: str, value: float) -> None:
    with pytest.raises(AgentError, match=name):
        DriveOptions(**{name: value})  # type: ignore[arg-type]


ENDLESS = """
import sys, time
import numpy as np
from jmm_agent.command_limits import CommandLimits
from jmm_agent.driving.drive import drive
from jmm_agent.guard.null_guard import NullGuard
from jmm_agent.observation import SensorReadings

class Robot:
    time = 0.0
    def read(self):
        time.sleep(0.01)
        self.time += 0.02
        return SensorReadings(self.time, np.zeros(2), np.zeros(2))
    def write(self, target_lengths):
        print("commanded", flush=True)
    def stop(self):
        print("stopped", flush=True)

class Agent:
    guard, limits = NullGuard(), CommandLimits()
    def step(self, readings):
        return readings.lengths

drive(Agent(), Robot(), 60.0)
"""


@pytest.mark.parametrize("ending", [signal.SIGTERM, signal.SIGHUP])
def test_the_robot_is_stopped_when_the_process_is_asked_to_end(ending: signal.Signals) -> None:
    with subprocess.Popen([sys.executable, "-c", ENDLESS], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"commanded\n"
        process.send_signal(ending)
        output = process.stdout.read().splitlines()
    assert output.count(b"stopped") == 1
    assert output[-1] == b"stopped"
    assert process.returncode == 128 + ending


def test_signals_are_what_they_were_after_a_drive() -> None:
    def mine(number: int, frame: object) -> None:
        """The caller's own handler."""

    before = signal.signal(signal.SIGHUP, mine)
    try:
        handlers = list[object]()
        driven(
            EchoAgent(), Robot(), watch=lambda *_: handlers.append(signal.getsignal(signal.SIGHUP))
        )
        assert set(handlers) == {mine}
        assert signal.getsignal(signal.SIGHUP) is mine
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
        assert signal.getsignal(signal.SIGALRM) is signal.SIG_DFL
    finally:
        signal.signal(signal.SIGHUP, before)


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
