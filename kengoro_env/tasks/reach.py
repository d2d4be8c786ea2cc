"""Reach joint angles, one target after the other.

The reward of a step is

    exp(-error / REWARD_SCALE) - EFFORT * (mean tension / EFFORT_SCALE),

with the root mean square error of the joint angles: dense, at most 1, larger the closer the arm,
and a little lower for wires that pull against each other. Success is an error below `TOLERANCE`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import exp, inf, radians, sqrt
from typing import Any

import numpy as np

from kengoro_env.robot.body import INSTANT
from kengoro_env.robot.robot import Robot
from kengoro_env.stepping.lift_monitor import Sight
from kengoro_env.tasks.task import Outcome
from kengoro_env.types import Floats

TARGET_PERIOD = 4.0
"""A new target comes every so often [s]."""

TOLERANCE = radians(5.0)
REWARD_SCALE = radians(20.0)
EFFORT, EFFORT_SCALE = 0.05, 500.0


def judged(square: float, tension: float) -> tuple[float, bool]:
    """Reward and success of a mean square error of the joints [rad^2] under a mean tension [N].

    In plain numbers, which is faster for one robot; NumPy's exponential has other bits.
    """
    error = sqrt(square)
    effort = min(tension / EFFORT_SCALE, 1.0)
    return exp(-error / REWARD_SCALE) - EFFORT * effort, error < TOLERANCE


class Reach:
    """Targets drawn one after the other; a target given as an option stays for the episode.

    Args:
        scene: MJCF file below assets/.
        has_camera: whether the scene has the camera in the head.
        draw: a start or target posture (n,) [rad].

    Attributes:
        goal: joint angles to reach now (n,) [rad]; None before the first start.
        until: from when on the present target makes way for another [s].
    """

    fingers = False
    options: Mapping[str, int | None] = {"target": None}
    shows_target = True
    thing: str | None = None

    def __init__(
        self,
        scene: str,
        has_camera: bool,
        draw: Callable[[np.random.Generator], Floats],
    ) -> None:
        self.scene, self.has_camera, self._draw = scene, has_camera, draw
        self.goal: Floats | None = None

    def start(
        self,
        robot: Robot,
        options: Mapping[str, Floats],
        rng: np.random.Generator,
        noise: np.random.Generator,
    ) -> None:
        """Start at a drawn or given posture, with a drawn or given target."""
        start, target = self._draw(rng), self._draw(rng)
        self._rng = rng
        self.goal = options.get("target", target).copy()
        self._targets = 1
        self.until = inf if "target" in options else TARGET_PERIOD - INSTANT
        robot.reset(options.get("posture", start), noise)

    def judge(
        self, info: dict[str, Any], error: float, tension: float, sight: Sight | None
    ) -> Outcome:
        """Reward and success for the present target; then a new one if it is time."""
        reward, info["success"] = judged(error, tension)
        if info["time"] >= self.until:
            self.go_on()
        return reward, None

    def go_on(self) -> None:
        """Choose a new target."""
        self.goal = self._draw(self._rng)
        self._targets += 1
        self.until = self._targets * TARGET_PERIOD - INSTANT

    def tell(self, info: dict[str, Any], sight: Sight | None) -> None:
        """Nothing beside what every task has."""
