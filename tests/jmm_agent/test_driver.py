"""The loop between an agent and the robot that it drives."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from typing import Any, cast

import numpy as np
import pytest

from jmm_agent.agent import Agent
from jmm_agent.driver import drive
from jmm_agent.errors import AgentError
from jmm_agent.observation import SensorReadings


class Robot:
    """Counts calls; its clock begins at 1000 s."""

    def __init__(self) -> None:
        self.time, self.commands, self.stopped = 1000.0, list[np.ndarray](), 0

    def read(self) -> SensorReadings:
        self.time += 0.02
        return SensorReadings(self.time, np.full(2, self.time), np.zeros(2))

    def write(self, target_lengths: np.ndarray) -> None:
        self.commands.append(target_lengths)

    def stop(self) -> None:
        self.stopped += 1


class EchoAgent:
    """Commands the measured lengths plus 1; raises after a time [s]."""

    def __init__(self, raises_at: float = np.inf) -> None:
        self.raises_at = raises_at

    def step(self, readings: SensorReadings) -> np.ndarray:
        if readings.time > self.raises_at:
            raise AgentError("Agent: lengths must be finite.")
        return readings.lengths + 1.0


def driven(agent: EchoAgent, robot: Robot, **more: Any) -> None:
    drive(cast(Agent, agent), robot, 0.1, **more)


def test_every_reading_is_answered_for_as_long_as_asked() -> None:
    robot, seen = Robot(), list[float]()

    driven(EchoAgent(), robot, watch=lambda readings, targets: seen.append(readings.time))

    assert seen == pytest.approx(1000.02 + 0.02 * np.arange(6))
    np.testing.assert_array_equal([c[0] - 1.0 for c in robot.commands], seen)
    assert robot.stopped == 0


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


ENDLESS = """
import sys, time
import numpy as np
from jmm_agent.driver import drive
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
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_thread_may_drive() -> None:
    robot = Robot()
    thread = threading.Thread(target=driven, args=(EchoAgent(), robot))
    thread.start()
    thread.join()
    assert len(robot.commands) == 6
