"""Stops a robot at the end of a program, with or without an error."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from jmm_agent.driving.driver import Driver, check_methods
from jmm_agent.driving.endings import endings_raised
from jmm_agent.driving.robot_stop import RobotStop


@contextmanager
def stopping(driver: Driver) -> Iterator[None]:
    """Within this context a robot is driven, and at its end `Driver.stop` is called.

    It also covers what lies between two calls of `drive`: planning, loading, waiting for a person.
    SIGTERM and SIGHUP end it, too, in the main thread, unless the caller handles them.

    Args:
        driver: of the robot; stopped twice if a `drive` has stopped it already.

    Raises:
        AgentError: the driver has no method ``stop``.
        SystemExit: a signal asked the process to end; the robot was stopped.
    """
    check_methods(driver, ("stop",))
    with endings_raised():
        try:
            yield
            driver.stop()
        except BaseException as error:
            RobotStop(driver).after(error)
            raise
