"""What ends a drive, and stops the robot."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from typing import Any

import numpy as np
import pytest

from jmm_agent.driving.call_watch import DriverTimeoutError
from jmm_agent.driving.drive import DriveOptions
from jmm_agent.driving.emergency_stop import EmergencyStop, EmergencyStopError
from jmm_agent.errors import AgentError
from jmm_agent.observation import SensorReadings
from tests.jmm_agent.driving.robots import EchoAgent, Robot, driven


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


ENDLESS = """
import signal, sys, time
import numpy as np
from jmm_agent.command_limits import CommandLimits
from jmm_agent.driving.drive import drive
from jmm_agent.guard.null_guard import NullGuard
from jmm_agent.observation import SensorReadings

signal.signal(signal.SIGHUP, signal.SIG_DFL)  # nohup ignores it

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
    guard, limits, stiffness = NullGuard(), CommandLimits(), None
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


def test_further_signals_do_not_interrupt_the_stop() -> None:
    class Slow(Robot):
        def stop(self) -> None:
            for ending in (signal.SIGTERM, signal.SIGHUP):
                signal.raise_signal(ending)
            super().stop()

    robot = Slow()
    with pytest.raises(SystemExit) as raised:
        driven(EchoAgent(), robot, watch=lambda *_: signal.raise_signal(signal.SIGTERM))
    assert raised.value.code == 128 + signal.SIGTERM
    assert robot.stopped == 1
