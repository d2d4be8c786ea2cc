"""A robot that is stopped at the end of a program."""

from __future__ import annotations

import signal
import subprocess
import sys
from typing import cast

import pytest

from jmm_agent.driving.driver import Driver
from jmm_agent.driving.stopping import stopping
from jmm_agent.errors import AgentError
from tests.jmm_agent.driving.robots import Robot

WAITING = """
import signal, time
from jmm_agent.driving.stopping import stopping

signal.signal(signal.SIGHUP, signal.SIG_DFL)  # nohup ignores it

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


def test_a_failure_to_stop_is_raised_and_hides_no_other_error() -> None:
    class Broken(Robot):
        def stop(self) -> None:
            super().stop()
            raise OSError("the line is down")

    with pytest.raises(OSError, match="the line is down"), stopping(Broken()):
        pass
    with pytest.raises(KeyError) as raised, stopping(Broken()):
        raise KeyError
    assert "the line is down" in raised.value.__notes__[0]


def test_a_second_interruption_does_not_keep_the_robot_from_stopping() -> None:
    class Interrupted(Robot):
        def stop(self) -> None:
            super().stop()
            if self.stopped == 1:
                raise KeyboardInterrupt

    robot = Interrupted()
    with pytest.raises(KeyError), stopping(robot):
        raise KeyError
    assert robot.stopped == 2


def test_a_driver_without_stop_is_refused_at_the_start() -> None:
    with pytest.raises(AgentError, match="lacks the method stop"), stopping(cast(Driver, object())):
        pytest.fail("it began")
