"""A robot and a mind together: the loop that every experiment runs.

The environment's ``info`` holds the truth. It is stripped here, before the agent: the agent gets
`SensorReadings` and nothing else, and the truth goes to the log. Faults that a guarded agent
notices are added to it as ``info["faults"]``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any

import gymnasium as gym
import numpy as np

from jmm_agent.agent import Agent
from jmm_agent.guard.faults import faults_for_info
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats
from kengoro.errors import UsageError
from kengoro_env.env import KengoroEnv

OPEN, CLOSED = -1.0, 1.0


class EpisodeEndedError(Exception):
    """The episode ended before the experiment did."""


@dataclass
class Log:
    """What happened, by control step; and by look.

    Attributes:
        time: [s].
        tensions: true tensions (m,) [N].
        target, true, estimate: joint angles (n,) [rad].
        look_time, look_error: time of each look [s], theta_est - theta_ik (n,) [rad].
    """

    time: list[float] = field(default_factory=list)
    tensions: list[Floats] = field(default_factory=list)
    target: list[Floats] = field(default_factory=list)
    true: list[Floats] = field(default_factory=list)
    estimate: list[Floats] = field(default_factory=list)
    observation_time: list[float] = field(default_factory=list)
    observation_error: list[Floats] = field(default_factory=list)


_onlooker: ContextVar[Callable[[Session], None] | None] = ContextVar("onlooker", default=None)


@contextmanager
def observed_by(onlooker: Callable[[Session], None]) -> Iterator[None]:
    """Sessions that begin here show themselves to ``onlooker`` after every step.

    Experiments make their sessions deep inside; so none has to pass the onlooker on. It must not
    change anything.
    """
    token = _onlooker.set(onlooker)
    try:
        yield
    finally:
        _onlooker.reset(token)


class Session:
    """One episode of an environment, driven by an agent.

    Args:
        env: a Kengoro environment.
        agent: its mind.
        seed: of the episode.
        watch: called with the session after every step, for videos and progress.
        options: of the reset.

    Attributes:
        stage: what the robot is doing, in a few words, for those who watch.
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        agent: Agent,
        seed: int,
        watch: Callable[[Session], None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> None:
        if not isinstance(env.unwrapped, KengoroEnv):
            raise UsageError(f"A session needs a Kengoro environment, not {env.unwrapped}.")
        self.env, self.world = env, env.unwrapped
        self.agent, self.log = agent, Log()
        self._watch, self._onlooker = watch, _onlooker.get()
        self.stage = ""
        self.fingers = OPEN
        self._seen: object = None
        self.observation, self.truth = env.reset(seed=seed, options=options)
        self._steps = 0
        agent.begin_episode()

    @property
    def readings(self) -> SensorReadings:
        """What the agent gets."""
        observation = self.observation
        frame_time = float(observation["frame_time"][0]) if "frame" in observation else -np.inf
        return SensorReadings(
            self._steps * self._period,
            observation["lengths"],
            observation["tensions"],
            observation.get("frame"),
            frame_time,
        )

    @property
    def _period(self) -> float:
        return float(self.world.robot.control_period)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._steps * self._period

    def step(self) -> None:
        """One control period.

        Raises:
            EpisodeEndedError: the environment says that the episode is over.
        """
        self.agent.hand_is_free = self.fingers == OPEN
        lengths = self.agent.step(self.readings)
        action = self.world.lengths_to_action(lengths, self.fingers)
        self.observation, _, ended, cut, self.truth = self.env.step(action)
        self._steps += 1
        if self.agent.guard is not None:
            self.truth["faults"] = faults_for_info(self.agent.faults)
        self._write()
        if self._watch is not None:
            self._watch(self)
        if self._onlooker is not None:
            self._onlooker(self)
        if ended or cut:
            raise EpisodeEndedError(str(self.truth.get("reason", "the time is up")))

    def _write(self) -> None:
        log = self.log
        log.time.append(self.time)
        log.tensions.append(self.world.robot.tensions)
        log.target.append(self.agent.target)
        log.true.append(self.truth["joint_angles"])
        log.estimate.append(self.agent.joint_angles)
        if self.agent.seen is not None and self.agent.seen is not self._seen:
            self._seen = self.agent.seen
            log.observation_time.append(self.time)
            log.observation_error.append(self.agent.seen.error)

    def wait(self, duration: float) -> None:
        """Let ``duration`` [s] pass."""
        for _ in range(round(duration / self._period)):
            self.step()

    def move(self, postures: Floats, duration: float, patience: float = 0.0) -> None:
        """Move through postures within ``duration`` [s], then wait up to ``patience`` [s] for rest.

        Rest means that the lengths have settled and what was to be learned from them is learned.
        """
        self.agent.go(postures, duration)
        self.wait(duration)
        end = self.time + patience
        while self.time < end and not self.agent.at_rest:
            self.step()
