"""What a robot, real or simulated, must be able to do for an agent to drive it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Protocol

from jmm_agent.agent import Agent
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats

ENDINGS = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that ask a process to end; Ctrl-C is an exception already."""


class Driver(Protocol):
    """A robot on its own clock, which the agent follows."""

    def read(self) -> SensorReadings:
        """Wait for the next control period, and say what is felt and seen.

        Time [s] increases from call to call; the newest camera frame may be an old one, its
        ``frame_time`` tells.
        """

    def write(self, target_lengths: Floats) -> None:
        """Command target muscle lengths (m,) [m], as the encoders call them, until the next."""

    def stop(self) -> None:
        """Leave the robot so that it can be left alone: called in the end, whatever happened."""


def drive(
    agent: Agent,
    driver: Driver,
    seconds: float,
    watch: Callable[[SensorReadings, Floats], None] = lambda readings, target_lengths: None,
) -> None:
    """Let an agent drive a robot for some time of the robot's clock.

    Call it again for the next posture (`Agent.go`); `Driver.stop` is left to the caller for when
    all is done, but is called here if anything goes wrong. SIGTERM and SIGHUP count as such: the
    robot is stopped, and SystemExit ends the process. That needs the main thread, where Python
    handles signals; a handler of the caller's own is left in its place.

    Args:
        agent: the mind.
        driver: the robot.
        seconds: how long [s].
        watch: called with what was felt and commanded, after every step.

    Raises:
        AgentError: the robot's senses cannot be used; it was stopped.
        SystemExit: the process was asked to end; the robot was stopped. Its code is 128 and the
            signal's number, as a shell reports it.
    """
    begin: float | None = None
    with _endings_raised():
        try:
            while True:
                readings = driver.read()
                begin = readings.time if begin is None else begin
                target_lengths = agent.step(readings)
                driver.write(target_lengths)
                watch(readings, target_lengths)
                if readings.time - begin >= seconds - 1e-9:
                    return
        except BaseException:
            driver.stop()
            raise


@contextmanager
def _endings_raised() -> Iterator[None]:
    """SIGTERM and SIGHUP raise SystemExit where they would end the process; the first one only."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    replaced = [number for number in ENDINGS if signal.getsignal(number) is signal.SIG_DFL]

    def end(number: int, frame: FrameType | None) -> None:
        for other in replaced:
            signal.signal(other, signal.SIG_IGN)  # the robot is being stopped already
        raise SystemExit(128 + number)

    try:
        for number in replaced:
            signal.signal(number, end)
        yield
    finally:
        for number in replaced:
            signal.signal(number, signal.SIG_DFL)
