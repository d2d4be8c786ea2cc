"""Log of an agent's calls, from which another agent repeats the run to the bit.

What an agent does depends on its calls and, where it learns beside the control loop, on the steps
at which results entered (`Agent.entered`). Both are in the log.
"""

from __future__ import annotations

from copy import deepcopy
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from jmm_agent.agent import Agent
from jmm_agent.command_limits import CommandLimits
from jmm_agent.learning.job_queue import Entered
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats

RECORDED = (
    "begin_episode",
    "close",
    "finish_learning",
    "go",
    "leave_out",
    "load",
    "observe",
    "recall",
    "repaired",
    "set_stiffness",
    "step",
    "zeroed",
)
"""Methods whose calls are recorded."""


class Call(NamedTuple):
    """One call of a method of an agent.

    Attributes:
        method: its name.
        arguments: by position.
        named: arguments by name.
        learning: `Agent.learning` at that time.
        hand_is_free: `Agent.hand_is_free` at that time.
        limits: `Agent.limits` at that time; `drive` sets them.
    """

    method: str
    arguments: tuple[Any, ...]
    named: dict[str, Any]
    learning: bool
    hand_is_free: bool
    limits: CommandLimits | None


class AgentLog(NamedTuple):
    """Calls of an agent.

    Attributes:
        calls: in order, from the first.
        entered: steps at which results entered.
    """

    calls: list[Call]
    entered: list[Entered]

    def replay(self, agent: Agent) -> list[Floats]:
        """Repeat the calls.

        Args:
            agent: made as the one that was recorded, with the same seed; wherever it learns.

        Returns:
            The target lengths (m,) [m] of each step.
        """
        agent.replay(self.entered)
        commands = []
        for call in self.calls:
            if call.learning != agent.learning:
                agent.learning = call.learning
            agent.hand_is_free, agent.limits = call.hand_is_free, call.limits
            result = getattr(agent, call.method)(*call.arguments, **call.named)
            if call.method == "step":
                commands.append(result)
        return commands


class RecordedAgent:
    """Agent whose calls are recorded; all else is as for the agent itself.

    Frames are kept in memory, one for each that is new: 1 MB each at 640 x 480 pixels.

    Args:
        agent: before its first call.
    """

    def __init__(self, agent: Agent) -> None:
        self._agent = agent
        self._calls: list[Call] = []
        self._frame: tuple[float, np.ndarray | None] = -np.inf, None

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._agent, name)
        return partial(self._call, name) if name in RECORDED else value

    def __setattr__(self, name: str, value: object) -> None:
        own = name in ("_agent", "_calls", "_frame")
        object.__setattr__(self if own else self._agent, name, value)

    @property
    def log(self) -> AgentLog:
        """What was recorded until now."""
        return AgentLog(list(self._calls), self._agent.entered)

    def _call(self, method: str, *arguments: Any, **named: Any) -> Any:
        """Record a call, and call the agent."""
        agent = self._agent
        recorded = tuple(self._copied(argument) for argument in arguments)
        kept = {name: self._copied(argument) for name, argument in named.items()}
        self._calls.append(
            Call(method, recorded, kept, agent.learning, agent.hand_is_free, agent.limits)
        )
        return getattr(agent, method)(*arguments, **named)

    def _copied(self, argument: Any) -> Any:
        """An argument whose arrays the caller may change."""
        if not isinstance(argument, SensorReadings):
            return np.array(argument) if isinstance(argument, np.ndarray) else argument
        if argument.frame_time != self._frame[0]:
            self._frame = argument.frame_time, deepcopy(argument.frame)
        return deepcopy(argument._replace(frame=None))._replace(frame=self._frame[1])
