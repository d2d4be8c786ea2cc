"""A robot that is stopped at the end of a program."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

from jmm_agent.driving.stopping import stopping
from tests.jmm_agent.driving.robots import Robot

WAITING = """
import time
from jmm_agent.driving.stopping import stopping

class Robot:
    def stop(self):
        print("stopped", flush=True)

with stopping(Robot()):
    print("ready", flush=True)
    time.sleep(60.0)
"""


def test_the_robot_is_stopped_with_and_without_an_error() -> None:
    robot = Robot()
    with stopping(robot):
        pass
    assert robot.stopped == 1
    with pytest.raises(KeyboardInterrupt), stopping(robot):
        raise KeyboardInterrupt
    assert robot.stopped == 2


@pytest.mark.parametrize("ending", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_between_two_drives_stops_the_robot(ending: signal.Signals) -> None:
    with subprocess.Popen([sys.executable, "-c", WAITING], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        process.send_signal(ending)
        assert process.stdout.read() == b"stopped\n"
    assert process.returncode == 128 + ending
