"""Session: the control loop of one episode, with the truth kept from the agent.

The environment's ``info`` holds the truth. Only `SensorReadings` reach the agent; the truth goes to
the log. Faults that the agent names are added to ``info["faults"]``.
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
from jmm_agent.vision.observation_prediction import ObservationPrediction
from kengoro.clock import Clock
from kengoro.errors import UsageError
from kengoro_env.env import KengoroEnv

OPEN, CLOSED = -1.0, 1.0
"""Commands of the fingers."""


class EpisodeEndedError(RuntimeError):
    """The environment ended the episode."""


@dataclass
class Log:
    """History of a session, with an entry for each control step and each marker observation.

    Attributes:
        time: at each step [s].
        tensions: true tensions at each step, shape (m,) [N].
        target, true, estimate: joint angles at each step, shape (n,) [rad].
        observation_time: of each marker observation [s].
        observation_error: theta_est - theta_ik at each observation, shape (n,) [rad].
        observation_predicted: what was expected of each observation before it was learned, with its
            distance from that; None where nothing was.
    """

    time: list[float] = field(default_factory=list)
    tensions: list[Floats] = field(default_factory=list)
    target: list[Floats] = field(default_factory=list)
    true: list[Floats] = field(default_factory=list)
    estimate: list[Floats] = field(default_factory=list)
    observation_time: list[float] = field(default_factory=list)
    observation_error: list[Floats] = field(default_factory=list)
    observation_predicted: list[ObservationPrediction | None] = field(default_factory=list)


_viewer: ContextVar[Callable[[Session], None] | None] = ContextVar("viewer", default=None)


@contextmanager
def shown_by(viewer: Callable[[Session], None]) -> Iterator[None]:
    """Within this context every new session calls ``viewer`` after each step.

    Code that makes sessions deep inside need not hand the viewer on. A viewer must not change the
    session.
    """
    token = _viewer.set(viewer)
    try:
        yield
    finally:
        _viewer.reset(token)


class Session:
    """One episode of an environment, driven by an agent.

    Args:
        env: a Kengoro environment.
        agent: controls the robot.
        seed: of the episode.
        watch: called with the session after every step, for films and progress.
        options: of `env.reset`.
        clock: of the time stamps that the agent is given; exact ones if left out.

    Attributes:
        stage: what the robot is doing, in a few words, for viewers.
        fingers: command of the fingers, `OPEN` or `CLOSED`.
        observation, truth: of the environment after the last step.
        log: history of the episode.

    Raises:
        UsageError: the environment is not one of Kengoro's.
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        agent: Agent,
        seed: int,
        watch: Callable[[Session], None] | None = None,
        options: dict[str, Any] | None = None,
        clock: Clock | None = None,
    ) -> None:
        if not isinstance(env.unwrapped, KengoroEnv):
            raise UsageError(f"A session needs a Kengoro environment, not {env.unwrapped}.")
        self.env, self.world = env, env.unwrapped
        self.agent, self.log = agent, Log()
        self._watch, self._viewer = watch, _viewer.get()
        self._command: Floats | None = None
        self._stiffness: Floats | None = None
        self.stage = ""
        self.fingers = OPEN
        self._seen: object = None
        self.observation, self.truth = env.reset(seed=seed, options=options)
        self._steps = 0
        self._clock = Clock() if clock is None else clock
        self._cycles = self._clock.cycles(self._period, seed)
        self._cycle = next(self._cycles)
        agent.begin_episode()
        self._set_stiffness(agent.stiffness)

    @property
    def readings(self) -> SensorReadings:
        """What the agent is given: sensor readings, and nothing of the truth."""
        observation = self.observation
        frame_time = float(observation["frame_time"][0]) if "frame" in observation else -np.inf
        return SensorReadings(
            self._cycle.stamp,
            observation["lengths"],
            observation["tensions"],
            observation.get("frame"),
            self._clock.at(frame_time),
            temperatures=observation.get("temperatures"),
        )

    @property
    def _period(self) -> float:
        return float(self.world.robot.control_period)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._steps * self._period

    def step(self) -> None:
        """Run one control period.

        Raises:
            EpisodeEndedError: the environment ended the episode.
        """
        self.step_by(self.agent.step)

    def step_by(self, controller: Callable[[SensorReadings], Floats]) -> None:
        """Run one control period in which something else than the agent may command the robot.

        Args:
            controller: returns target lengths (m,) [m] for sensor readings.

        Raises:
            EpisodeEndedError: the environment ended the episode.
        """
        self.agent.hand_is_free = self.fingers == OPEN
        command, stiffness = self._command, self._stiffness
        if not self._cycle.lost:
            self._command = controller(self.readings)
        if not self._cycle.late:
            command, stiffness = self._command, self.agent.stiffness
        self._set_stiffness(stiffness)
        action = self.world.lengths_to_action(command, self.fingers)
        self.observation, _, ended, cut, self.truth = self.env.step(action)
        self._steps += 1
        self._cycle = next(self._cycles)
        self.truth["faults"] = faults_for_info(self.agent.faults)
        self._write()
        if self._watch is not None:
            self._watch(self)
        if self._viewer is not None:
            self._viewer(self)
        if ended or cut:
            raise EpisodeEndedError(str(self.truth.get("reason", "the time is up")))

    def _set_stiffness(self, stiffness: Floats | None) -> None:
        """Pass K_stiff (m,) [N/m] of the agent to the motors, if it is another than before."""
        if stiffness is None:
            return
        if self._stiffness is None or not np.array_equal(self._stiffness, stiffness):
            self.world.set_stiffness(stiffness)
        self._stiffness = stiffness

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
            newest, predicted = self.agent.predictions.newest, self.agent.seen.predicted
            log.observation_predicted.append(
                newest[-1].predicted if predicted is not None else None
            )

    def wait(self, duration: float) -> None:
        """Step until ``duration`` [s] has passed."""
        for _ in range(round(duration / self._period)):
            self.step()

    def move(self, postures: Floats, duration: float, patience: float = 0.0) -> None:
        """Move through postures, then wait until the robot is at rest.

        At rest the lengths have settled, and what is to be learned from them is learned.

        Args:
            postures: joint angles, shape (K, n) or (n,) [rad].
            duration: of the movement [s].
            patience: longest wait for rest [s].
        """
        self.agent.go(postures, duration)
        self.wait(duration)
        end = self.time + patience
        while self.time < end and not self.agent.at_rest:
            self.step()
