"""One recorded episode, and the wrapper of an environment that records it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from jmm_agent.types import Floats
from kengoro.errors import UsageError
from kengoro_env.vision.head_camera import PERIOD
from kengoro_env.vision.rendering import Image

STATES = ("lengths", "tensions", "frame_time")
"""Entries of observations that are recorded; frames go elsewhere."""
TRUTHS = ("can_pose", "grasped", "rise", "success")
"""Entries of ``info`` that are recorded."""


@dataclass(frozen=True)
class Episode:
    """What a robot did, with T control steps and m muscles.

    Arrays with T + 1 entries begin with the reset.

    Attributes:
        lengths: encoder readings, shape (T + 1, m) [m].
        tensions: readings of the tension sensors, shape (T + 1, m) [N].
        frame_time: time stamp of the newest frame, shape (T + 1, 1) [s].
        actions: shape (T, m + 1), float32, with the fingers last.
        rewards: shape (T,).
        terminations: whether a step ended the episode, shape (T,).
        can_pose: true pose of the can in the world, shape (T + 1, 4, 4).
        grasped: whether the hand held the can, shape (T + 1,).
        rise: of the can above its start, shape (T + 1,) [m].
        success: whether the can was lifted for long enough, shape (T + 1,).
    """

    lengths: Floats
    tensions: Floats
    frame_time: Floats
    actions: NDArray[np.float32]
    rewards: Floats
    terminations: NDArray[np.bool_]
    can_pose: Floats
    grasped: NDArray[np.bool_]
    rise: Floats
    success: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.rewards)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays by their names."""
        return {entry.name: getattr(self, entry.name) for entry in fields(self)}

    @property
    def lifted(self) -> bool:
        """Whether the can was lifted for long enough, and held to the end."""
        return bool(self.success[-1] and self.grasped[-1])


class Recorder(gym.Wrapper[Any, Any, Any, Any]):
    """Records the episode since the last reset.

    A frame is handed on before each step that begins a period of the camera: it is the newest one
    that had arrived by then, and so belongs to that step's observation.

    Args:
        env: an environment of the task CanGrasp.
        add_frame: called with the frame, shape (480, 640, 3), at the camera's rate; None: without.
    """

    def __init__(
        self, env: gym.Env[Any, Any], add_frame: Callable[[Image], None] | None = None
    ) -> None:
        super().__init__(env)
        self._add_frame = add_frame
        self._stride = frame_stride(float(self.unwrapped.robot.control_period))  # type: ignore[attr-defined]
        self._rows: dict[str, list[Any]] = {}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode and a recording."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._rows = {entry.name: [] for entry in fields(Episode)}
        self._keep(observation, info)
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Record one control step."""
        if self._add_frame is not None and len(self._rows["rewards"]) % self._stride == 0:
            self._add_frame(self._observation["frame"])
        observation, reward, terminated, truncated, info = self.env.step(action)
        for name, value in zip(
            ("actions", "rewards", "terminations"), (action, reward, terminated), strict=True
        ):
            self._rows[name].append(np.array(value))
        self._keep(observation, info)
        return observation, reward, terminated, truncated, info

    def _keep(self, observation: Any, info: dict[str, Any]) -> None:
        self._observation = observation
        for names, source in ((STATES, observation), (TRUTHS, info)):
            for name in names:
                self._rows[name].append(np.array(source[name]))

    @property
    def episode(self) -> Episode:
        """The episode until now.

        Raises:
            UsageError: no step has been made.
        """
        if not self._rows.get("rewards"):
            raise UsageError("There is no episode: no step was recorded.")
        return Episode(**{name: np.array(rows) for name, rows in self._rows.items()})


def frame_stride(control_period: float) -> int:
    """Number of control steps in a period of the camera.

    Args:
        control_period: duration of a step [s].
    """
    return round(PERIOD / control_period)
