"""What a robot, real or simulated, must be able to do for an agent to drive it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from jmm_agent.agent import Agent
from jmm_agent.drawing import Floats
from jmm_agent.senses import Senses


class Driver(Protocol):
    """A robot on its own clock, which the agent follows."""

    def read(self) -> Senses:
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
    watch: Callable[[Senses, Floats], None] = lambda senses, target_lengths: None,
) -> None:
    """Let an agent drive a robot for some time of the robot's clock.

    Call it again for the next posture (`Agent.go`); `Driver.stop` is left to the caller for when
    all is done, but is called here if anything goes wrong.

    Args:
        agent: the mind.
        driver: the robot.
        seconds: how long [s].
        watch: called with what was felt and commanded, after every step.

    Raises:
        AgentError: the robot's senses cannot be used; it was stopped.
    """
    begin: float | None = None
    try:
        while True:
            senses = driver.read()
            begin = senses.time if begin is None else begin
            target_lengths = agent.step(senses)
            driver.write(target_lengths)
            watch(senses, target_lengths)
            if senses.time - begin >= seconds - 1e-9:
                return
    except BaseException:
        driver.stop()
        raise
