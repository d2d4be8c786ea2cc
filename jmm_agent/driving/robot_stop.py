"""Stops a robot once, from whichever thread notices first."""

from __future__ import annotations

import threading

from jmm_agent.driving.driver import Driver

PATIENCE = 2.0
"""Longest wait for another thread that stops the robot already [s]."""


class RobotStop:
    """Calls `Driver.stop` until it has returned or failed once.

    Args:
        driver: of the robot.

    Attributes:
        done: whether `Driver.stop` has returned or failed.
        failure: error of `Driver.stop`, or None.
    """

    def __init__(self, driver: Driver) -> None:
        self._driver = driver
        self._lock = threading.Lock()
        self.done = False
        self.failure: Exception | None = None

    def __call__(self) -> None:
        """Stop the robot, or wait for the thread that is stopping it."""
        if not self._lock.acquire(timeout=PATIENCE):
            self.failure = TimeoutError(f"Driver.stop has not returned within {PATIENCE} s")
            return
        try:
            if self.done:
                return
            try:
                self._driver.stop()
            except Exception as error:
                self.failure = error
            self.done = True
        finally:
            self._lock.release()

    def after(self, error: BaseException) -> None:
        """Stop the robot after an error, to which a failure to stop is added as a note.

        Args:
            error: that ends the drive.
        """
        try:
            self()
        except BaseException:  # a second Ctrl-C or signal, while the robot was being stopped
            self()
        if self.failure is not None:
            error.add_note(f"The robot may not have stopped: Driver.stop failed: {self.failure!r}.")
