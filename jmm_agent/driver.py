"""Interface of a robot, real or simulated, and the control loop that an agent drives it with."""

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
"""Signals that ask a process to end, besides SIGINT, which Python raises as an exception."""


class Driver(Protocol):
    """A robot with its own clock, which the agent follows."""

    def read(self) -> SensorReadings:
        """Wait for the next control period, and return its sensor readings.

        Returns:
            Readings whose time [s] increases from call to call. Their camera frame is the newest
            one, and may be old, see ``frame_time``.
        """

    def write(self, target_lengths: Floats) -> None:
        """Command target muscle lengths until the next call.

        Args:
            target_lengths: (m,) [m], from the same zero as the measured lengths.
        """

    def stop(self) -> None:
        """Bring the robot into a safe state; called in the end, also after an error."""


def drive(
    agent: Agent,
    driver: Driver,
    seconds: float,
    watch: Callable[[SensorReadings, Floats], None] = lambda readings, target_lengths: None,
) -> None:
    """Let an agent drive a robot for some time of the robot's clock.

    Call it again for the next posture (`Agent.go`). The caller calls `Driver.stop` at the very end;
    here it is called after any error. SIGTERM and SIGHUP count as errors in the main thread, where
    Python handles signals: the robot is stopped, and SystemExit ends the process. A handler that
    the caller has installed stays in place.

    Args:
        agent: the agent.
        driver: the robot.
        seconds: duration [s].
        watch: called with the readings and the target lengths (m,) [m] after every step.

    Raises:
        AgentError: the readings cannot be used; the robot was stopped.
        SystemExit: a signal asked the process to end; the robot was stopped. The exit code is 128
            plus the signal's number, as in a shell.
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
    """Let the first SIGTERM or SIGHUP raise SystemExit, unless the caller handles it."""
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
