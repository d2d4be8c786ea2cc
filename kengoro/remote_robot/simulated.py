"""A simulated robot as a driver."""

from __future__ import annotations

from types import TracebackType

import numpy as np

from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats
from kengoro.robots import NO_END, make_env
from kengoro_env.env import KengoroEnv


class SimulatedRobot:
    """An environment of Kengoro's arm as a `jmm_agent.Driver`; holds its last command when stopped.

    Args:
        task: of the environment, such as "Posture".
        seed: of the actual robot and of its sensor noise; None for the nominal model.
    """

    def __init__(self, task: str, seed: int | None) -> None:
        self._env = make_env(task, seed, max_episode_steps=NO_END)
        world = self._env.unwrapped
        assert isinstance(world, KengoroEnv)
        self._world = world
        self._observation, _ = self._env.reset(seed=seed or 0)
        self._command, self._step = world.robot.target, -1

    @property
    def muscles(self) -> int:
        """Number of muscles, m."""
        return len(self._world.muscles)

    def __enter__(self) -> SimulatedRobot:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._env.close()

    def read(self) -> SensorReadings:
        """Run one control period with the last command; the first call returns the start."""
        self._step += 1
        if self._step:
            action = self._world.lengths_to_action(self._command)
            self._observation, *_ = self._env.step(action)
        observation = self._observation
        frame = observation.get("frame")
        return SensorReadings(
            self._step * float(self._world.robot.control_period),
            observation["lengths"],
            observation["tensions"],
            frame,
            -np.inf if frame is None else float(observation["frame_time"][0]),
        )

    def write(self, target_lengths: Floats) -> None:
        """Command target muscle lengths (m,) [m]."""
        self._command = target_lengths

    def stop(self) -> None:
        """Hold the last command: the arm would fall if its muscles relaxed."""
