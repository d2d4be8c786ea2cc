"""Stops a robot at the end of a program, whatever ends it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from jmm_agent.driving.driver import Driver
from jmm_agent.driving.endings import endings_raised


@contextmanager
def stopping(driver: Driver) -> Iterator[None]:
    """Within this context a robot is driven, and at its end `Driver.stop` is called.

    It also covers what lies between two calls of `drive`: planning, loading, waiting for a person.
    SIGTERM and SIGHUP end it, too, in the main thread, unless the caller handles them.

    Args:
        driver: of the robot; stopped twice if a `drive` has stopped it already.

    Raises:
        SystemExit: a signal asked the process to end; the robot was stopped.
    """
    with endings_raised():
        try:
            yield
        finally:
            driver.stop()
