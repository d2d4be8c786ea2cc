"""Watchdog for the driver's side of a robot: notices that commands have stopped coming.

The agent's process may be killed, hang, or lose its connection, and then it cannot call
`Driver.stop`. So the program beside the motors measures the time since the last fresh command, and
stops the robot by itself. This file needs nothing but Python: copy it into the driver of a real
robot.
"""

from __future__ import annotations

import time
from collections.abc import Callable

PERIODS = 4
"""Periods without a fresh command after which the robot stops, if nothing else is given."""


class Watchdog:
    """Expires when no fresh command has come for some control periods, and stays expired.

    A command is fresh if its number is higher than any before, so that packets that the network
    repeats do not keep a robot moving. It starts with the first command.

    Args:
        period: control period [s].
        periods: number of periods without a fresh command after which it expires.
        clock: time [s], which must not jump.

    Raises:
        ValueError: the period is not positive and finite, or there is less than one period.
    """

    def __init__(
        self,
        period: float,
        periods: float = PERIODS,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if not (0.0 < period < float("inf") and 1.0 <= periods < float("inf")):
            raise ValueError(
                f"Watchdog: a period of {period} s and {periods} periods; the period must be "
                "positive and finite, and at least one period must pass."
            )
        self.timeout = period * periods
        self._clock = clock
        self.reset()

    def reset(self) -> None:
        """Forget all commands, as before another agent takes over."""
        self._newest = -1
        self._last: float | None = None
        self._expired = False

    def command(self, number: int) -> bool:
        """Note a command.

        Args:
            number: of the command; higher from one to the next.

        Returns:
            Whether the command may be carried out: it is fresh, and the watchdog has not expired.
        """
        if self.expired or number <= self._newest:
            return False
        self._newest, self._last = number, self._clock()
        return True

    def pause(self) -> None:
        """Expect no commands until the next one, after a message of the agent."""
        if not self.expired:
            self._last = None

    @property
    def expired(self) -> bool:
        """Whether the robot must be stopped, or was; only `reset` changes it back."""
        if self._last is not None and self._clock() - self._last >= self.timeout - 1e-9:
            self._expired = True
        return self._expired
