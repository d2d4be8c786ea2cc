"""An arm before a can, moved by one command for each period of the camera."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from experiments.cloning.can_camera import MIDDLE, CanCamera, CanSource
from experiments.cloning.features import STRIDE, features, origin
from jmm_agent.types import Floats
from kengoro.hand_search import READY
from kengoro.robots import make_env
from kengoro_env.env import KengoroEnv
from kengoro_env.robot.own_model import Model


class RowArm:
    """The task CanGrasp from the posture beside the body, in rows of `STRIDE` control steps.

    Commands of muscles go straight from that of the row before; those of the fingers jump.

    Args:
        robot: seed of the actual robot; None: the drawing.
        can: where the can's position comes from.
        model: a model in place of the drawing.

    Attributes:
        can_seen: whether the can was seen in this episode, which it is in the state.
        can_error: distance of the position that policies are given from the true one [m].
    """

    def __init__(
        self, robot: int | None, can: CanSource = "state", model: Model | None = None
    ) -> None:
        if model is None:
            self._env = make_env("CanGrasp", robot, camera=False)
        else:
            self._env = gym.make("Kengoro/CanGrasp-v0", camera=False, model=model)
        world = self._env.unwrapped
        assert isinstance(world, KengoroEnv)
        self._world = world
        self._camera = CanCamera(robot) if can == "camera" else None

    def reset(self, seed: int) -> dict[str, Any]:
        """Begin the episode of a seed, and return the environment's ``info``."""
        observation, info = self._world.reset(seed=seed, options={"posture": np.array(READY)})
        true = info["can_pose"][:2, 3].copy()
        found = true if self._camera is None else self._camera.measured(seed)
        self.can_seen = found is not None
        self._can = MIDDLE if found is None else found
        self.can_error = float(np.linalg.norm(self._can - true))
        self._readings = [np.append(observation["lengths"], observation["tensions"])]
        self._command = self._world.lengths_to_action(observation["lengths"])
        return info

    @property
    def command(self) -> Floats:
        """Command at the end of the last row, shape (m + 1,)."""
        return self._command.astype(float)

    @property
    def can(self) -> Floats:
        """Horizontal position of the can that policies are given, shape (2,) [m]."""
        return self._can.copy()

    def inputs(self, history: bool) -> Floats:
        """Input of a policy now, see `features`, shape (D,)."""
        return features(self._readings, self._can, history)

    def origin(self, history: bool) -> Floats:
        """Command (m + 1,) from which those of a policy count, see `origin`."""
        return origin(self._readings[0][: len(self._command) - 1], history)

    def step(self, command: NDArray[np.floating[Any]]) -> tuple[float, bool, dict[str, Any]]:
        """Move to a command in one row.

        Args:
            command: at the end of the row, shape (m + 1,) in [-1, 1], with the fingers last.

        Returns:
            Mean reward of the control steps, whether the episode ended, and ``info``.
        """
        before, self._command = self._command, command.astype(np.float32)
        rewards = []
        for step in range(1, STRIDE + 1):
            action = before + (self._command - before) * np.float32(step / STRIDE)
            action[-1] = self._command[-1]
            observation, reward, ended, _, info = self._world.step(np.clip(action, -1.0, 1.0))
            rewards.append(float(reward))
            if ended:
                break
        self._readings.append(np.append(observation["lengths"], observation["tensions"]))
        return float(np.mean(rewards)), ended, info

    def close(self) -> None:
        """Close the environments."""
        self._env.close()
        if self._camera is not None:
            self._camera.close()
