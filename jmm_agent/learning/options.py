"""Options of learning: where it runs, and at which step its results enter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from jmm_agent.errors import AgentError

AS_SOON = -1
"""Value of `LearningOptions.enters_after` for results that enter as soon as they are there."""


@dataclass(frozen=True)
class LearningOptions:
    """Where learning jobs run, and when their results enter the agent.

    Attributes:
        where: "step": within the control step, which then takes as long as learning does;
            "process": in a process beside the control loop, frames in a thread.
        enters_after: number of control steps after which a result enters. The step waits for it if
            it is not there yet, so that runs with the same readings are the same to the bit.
            `AS_SOON`: a result enters at the first step at which it is there; `Agent.entered` holds
            that step, and `replay` repeats such a run to the bit.
        timeout: a job in the process that takes longer is given up [s].

    Raises:
        AgentError: a number is out of range, or a word unknown.
    """

    where: Literal["step", "process"] = "step"
    enters_after: int = 0
    timeout: float = 30.0

    def __post_init__(self) -> None:
        if self.where not in ("step", "process"):
            raise AgentError(
                f"LearningOptions: where is {self.where!r}, but must be 'step' or 'process'."
            )
        if self.enters_after != int(self.enters_after) or self.enters_after < AS_SOON:
            raise AgentError(
                f"LearningOptions: enters_after is {self.enters_after}, but must be a number of "
                f"steps, or {AS_SOON} for as soon as possible."
            )
        if not self.timeout > 0.0:
            raise AgentError(f"LearningOptions: timeout is {self.timeout} s, but must be positive.")


BESIDE = LearningOptions("process", AS_SOON)
"""For a live robot: learning never prolongs a control step."""
