"""Reach joint angles, one target after the other.

The reward of a step is

    exp(-error / REWARD_SCALE) - EFFORT * (mean tension / EFFORT_SCALE),

with the root mean square error of the joint angles: dense, at most 1, larger the closer the arm,
and a little lower for wires that pull against each other. Success is an error below `TOLERANCE`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kengoro_env.robot import Robot
from kengoro_env.tasks.task import Outcome

Array = NDArray[np.float64]

TARGET_PERIOD = 4.0
"""A new target comes every so often [s]."""

TOLERANCE = radians(5.0)
REWARD_SCALE = radians(20.0)
EFFORT, EFFORT_SCALE = 0.05, 500.0


class Reach:
    """Targets drawn one after the other; a target given as an option stays for the episode.

    Args:
        scene: MJCF file below assets/.
        has_camera: whether the scene has the camera in the head.
        draw: a start or target posture (n,) [rad].
    """

    fingers = False
    options: Mapping[str, int | None] = {"target": None}
    shows_target = True

    def __init__(
        self,
        scene: str,
        has_camera: bool,
        draw: Callable[[np.random.Generator], Array],
    ) -> None:
        self.scene, self.has_camera, self._draw = scene, has_camera, draw

    def start(
        self,
        robot: Robot,
        options: Mapping[str, Array],
        rng: np.random.Generator,
        noise: np.random.Generator,
    ) -> None:
        """Start at a drawn or given posture, with a drawn or given target."""
        start, target = self._draw(rng), self._draw(rng)
        self._rng, self._stays = rng, "target" in options
        self._target = options.get("target", target).copy()
        self._targets = 1
        robot.reset(options.get("posture", start), noise)

    def target(self) -> Array:
        """Joint angles to reach now (n,) [rad]."""
        return self._target.copy()

    def judge(self, robot: Robot) -> Outcome:
        """Reward and success for the present target; then a new one if it is time."""
        error = float(np.sqrt(np.mean((robot.joint_angles - self._target) ** 2)))
        effort = float(np.mean(robot.tensions)) / EFFORT_SCALE
        reward = float(np.exp(-error / REWARD_SCALE)) - EFFORT * min(effort, 1.0)
        if not self._stays and robot.time + 1e-6 >= self._targets * TARGET_PERIOD:
            self._target = self._draw(self._rng)
            self._targets += 1
        return Outcome(reward, error < TOLERANCE)

    def truth(self, robot: Robot) -> dict[str, Any]:
        """Nothing beside what every task has."""
        return {}
