"""Process that forks an agent for each trial, so that none has to import and train first.

Each line of JSON on its standard input is a trial. It prints what happens as lines of JSON. Where a
connection is to stay half open after its agent was killed, as when its computer loses power, this
process holds the socket, too, so that nothing is sent when the agent's copy is closed.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from experiments.lab_faults.lab_robot import SCENE, STEP
from experiments.lab_faults.pose_frames import PoseDetector
from experiments.lab_faults.processes import raise_priority
from jmm_agent.agent import Agent
from jmm_agent.driving.autosave import Autosave
from jmm_agent.driving.drive import drive
from jmm_agent.driving.stopping import stopping
from jmm_agent.memory_file import AgentMemory
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats
from kengoro.agents import make_agent
from kengoro.remote_robot.client import RemoteRobot
from kengoro.robots import sample_postures

POSTURES = 200
MOVE, REST = 0.4, 0.8
"""Duration of a movement and of the rest after it, on the robot's clock [s]."""
LONGEST = 100.0
"""Longest trial, on the robot's clock [s]."""
LATE = 2.0
"""Control periods that a step may take."""
ENDED = 3
"""Exit code of an agent that an error has ended."""


class LostItselfError(RuntimeError):
    """Raised within the loop, as by an error in someone's code."""


def print_event(**event: Any) -> None:
    """Print an event; lines of several processes do not mix."""
    os.write(1, (json.dumps(event) + "\n").encode())


class TimedRobot:
    """Driver that reports control steps so long that the watchdog may have expired.

    Args:
        robot: that it drives.
    """

    def __init__(self, robot: RemoteRobot) -> None:
        self._robot = robot
        self._longest = LATE * (robot.period or np.inf)
        self._begin = 0.0

    def read(self) -> SensorReadings | None:
        """Wait for the next sensor readings; the control step begins with them."""
        readings = self._robot.read()
        self._begin = time.monotonic()
        return readings

    def write(self, target_lengths: Floats) -> None:
        """Command target muscle lengths (m,) [m], which ends the control step."""
        if time.monotonic() - self._begin > self._longest:
            print_event(event="late_step")
        self._robot.write(target_lengths)

    def stop(self) -> None:
        """Stop the robot."""
        self._robot.stop()


class Trial:
    """One agent, which drives until it is stopped.

    Args:
        agent: that has learned nothing yet.
        order: ``port``, ``memory``, ``seed``, and ``raises``: after how many steps, or null.
        robot: that is connected already; None to connect.

    Attributes:
        robot: that it drives.
    """

    def __init__(self, agent: Agent, order: dict[str, Any], robot: RemoteRobot | None) -> None:
        self._agent, self._order = agent, order
        self.robot = RemoteRobot(order["port"]) if robot is None else robot
        self._steps, self._observations = 0, -1
        order_of = np.random.default_rng(order["seed"]).permutation(POSTURES)
        self._written: AgentMemory | None = None
        self._postures = iter(sample_postures(SCENE, POSTURES)[order_of])
        self._moves_at = -np.inf

    def run(self) -> None:
        """Load what was learned, and drive from posture to posture."""
        agent, memory = self._agent, Path(self._order["memory"])
        if memory.is_file():
            agent.load(memory)
        self._observations = self._count
        with Autosave(agent, memory) as autosave:  # as `drive` has with ``memory``
            self._autosave = autosave
            drive(agent, TimedRobot(self.robot), LONGEST, self._watch)

    @property
    def _count(self) -> int:
        return len(self._agent.vision.memory.observations)

    def _watch(self, readings: SensorReadings, target_lengths: Floats) -> None:
        """Report that it drives, and what was learned; fail at the step at which it must."""
        tick = round(readings.time / STEP)
        if self._steps == 0:
            print_event(event="began", pid=os.getpid(), observations=self._observations)
        self._autosave.step()
        written = self._autosave.written
        if written is not self._written and written is not None:
            self._written = written
            print_event(event="saved", observations=len(written.vision.observations))
        if self._count != self._observations:
            self._observations = self._count
            print_event(event="learned", observations=self._observations)
        if readings.time - self._moves_at >= MOVE + REST:
            self._moves_at = readings.time
            self._agent.go(next(self._postures), MOVE)
        self._steps += 1
        if self._steps == self._order["raises"]:
            print_event(event="raised", tick=tick)
            raise LostItselfError("an error in someone's code")


def run_forked(agent: Agent, order: dict[str, Any], robot: RemoteRobot | None) -> int:
    """Run a trial in the forked process; its exit code."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    try:
        trial = Trial(agent, order, robot)
        with stopping(trial.robot):
            trial.run()
    except SystemExit as ending:
        return int(ending.code or 0)
    except Exception as error:
        print_event(event="ended", error=f"{type(error).__name__}: {error}")
        return ENDED
    return 0


def main() -> None:
    """Fork an agent for each line of the standard input."""
    logging.disable(logging.WARNING)  # of lost readings, which are what is tried
    agent = make_agent(scene=SCENE, detector=PoseDetector(), marker_sides={0: 0.05})
    raise_priority()
    print_event(event="ready")
    held: RemoteRobot | None = None
    for line in sys.stdin:
        order = json.loads(line)
        if held is not None:
            held.stop()
            held = None
        if "port" not in order:
            continue
        held = RemoteRobot(order["port"]) if order["half_open"] else None
        pid = os.fork()
        if pid == 0:
            code = 1
            with contextlib.suppress(BaseException):
                code = run_forked(agent, order, held)
            os._exit(code)
        _, status = os.waitpid(pid, 0)
        print_event(event="exit", code=os.waitstatus_to_exitcode(status))


if __name__ == "__main__":
    main()
