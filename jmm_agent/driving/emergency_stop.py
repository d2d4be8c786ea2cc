"""Emergency stop: a latch that stops the robot and stays until a person resets it."""

from __future__ import annotations

from jmm_agent.errors import AgentError


class EmergencyStopError(AgentError):
    """The emergency stop is triggered."""


class EmergencyStop:
    """Latch that ends every `drive`, and lets no other begin, until `reset`.

    It may be triggered from any thread and from a signal handler. `drive` triggers it on a
    KeyboardInterrupt, too.
    """

    def __init__(self) -> None:
        # One assignment, without a lock: a signal handler must not wait for the thread it is in.
        self._reason: str | None = None

    @property
    def triggered(self) -> bool:
        """Whether it is triggered."""
        return self._reason is not None

    def trigger(self, reason: str = "the emergency stop was pressed") -> None:
        """Stop the robot, and keep it stopped.

        Args:
            reason: for the error message; the first one stays.
        """
        if self._reason is None:
            self._reason = reason

    def reset(self) -> None:
        """Allow `drive` again; for a person who has looked at the robot, not for a program."""
        self._reason = None

    def check(self) -> None:
        """Do nothing unless it is triggered.

        Raises:
            EmergencyStopError: it is triggered.
        """
        reason = self._reason
        if reason is not None:
            raise EmergencyStopError(
                f"Emergency stop: {reason}. The robot stays stopped until EmergencyStop.reset() is "
                "called."
            )
