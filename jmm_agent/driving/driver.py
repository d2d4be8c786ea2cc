"""Interface of a robot, real or simulated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from jmm_agent.errors import AgentError
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats


class Driver(Protocol):
    """A robot with its own clock, which the agent follows.

    A driver of a real robot has a `Watchdog` on the side of the motors, because the process of the
    agent may be killed. A driver that also has a method ``pause`` is a `PausingDriver`, and one
    with ``set_stiffness`` a `StiffnessDriver`.
    """

    def read(self) -> SensorReadings | None:
        """Wait for the next control period, and return its sensor readings.

        It should wait at most for one or two control periods, and then return None.

        Returns:
            Readings whose time [s] increases from call to call; their camera frame is the newest
            one, and may be old, see ``frame_time``. None if no readings came (a lost packet).
        """

    def write(self, target_lengths: Floats) -> None:
        """Command target muscle lengths until the next call.

        Args:
            target_lengths: (m,) [m], finite, from the same zero as the measured lengths.
        """

    def stop(self) -> None:
        """Bring the robot into a safe state; called in the end, also after an error.

        It must return soon, may be called twice, and may be called from another thread while `read`
        or `write` does not return.
        """


@runtime_checkable
class PausingDriver(Driver, Protocol):
    """A driver whose watchdog can be paused while no commands come."""

    def pause(self) -> None:
        """Hold the last command until the next one; called after each `drive` without an error."""


@runtime_checkable
class StiffnessDriver(Driver, Protocol):
    """A driver of motors whose stiffness can be changed, as `Agent.set_stiffness` needs."""

    def set_stiffness(self, stiffness: Floats) -> None:
        """Set K_stiff until the next call; called just before the `write` that belongs to it.

        Args:
            stiffness: K_stiff of each muscle (m,) [N/m], finite and positive.
        """


def check_methods(driver: object, needed: Sequence[str] = ("read", "write", "stop")) -> None:
    """Refuse a driver that lacks a method, before the robot moves.

    Args:
        driver: of the robot.
        needed: names of the methods.

    Raises:
        AgentError: one is missing.
    """
    missing = [name for name in needed if not callable(getattr(driver, name, None))]
    if missing:
        raise AgentError(
            f"The driver {type(driver).__name__} lacks the method {' and '.join(missing)}; a "
            "driver has read, write and stop."
        )
