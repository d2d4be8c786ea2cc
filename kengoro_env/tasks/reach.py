"""Reach joint angles, one target after the other.

The reward of a step is

    exp(-error / REWARD_SCALE) - EFFORT * (mean tension / EFFORT_SCALE),

where error is the root mean square error of the joint angles. It is at most 1, increases as the arm
approaches the target, and is slightly lower for muscles that pull against each other. Success is an
error below `TOLERANCE`. The constants are in `kengoro_env.stepping.reach_reward`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import Any

import numpy as np

from kengoro_env.robot.body import INSTANT
from kengoro_env.robot.robot import Robot
from kengoro_env.stepping.reach_reward import judged
from kengoro_env.stepping.tracked_object import ObjectState
from kengoro_env.tasks.task import Outcome
from kengoro_env.types import Floats

TARGET_PERIOD = 4.0
"""Time between two targets [s]."""


class Reach:
    """Targets that change every `TARGET_PERIOD`; a target given as an option stays.

    Args:
        scene: MJCF file below assets/.
        has_camera: whether the scene has the camera in the head.
        sample: samples a start or target posture (n,) [rad] within lower and upper joint limits
            (n,) [rad].

    Attributes:
        goal: joint angles to reach now (n,) [rad]; None before the first start.
        until: time of the next target [s].
    """

    fingers = False
    options: Mapping[str, int | None] = {"target": None}
    shows_target = True
    object_name: str | None = None
    elements: Sequence[tuple[str, str]] = ()

    def __init__(
        self,
        scene: str,
        has_camera: bool,
        sample: Callable[[np.random.Generator, Floats, Floats], Floats],
    ) -> None:
        self.scene, self.has_camera, self._sample = scene, has_camera, sample
        self.goal: Floats | None = None

    def start(
        self,
        robot: Robot,
        options: Mapping[str, Floats],
        rng: np.random.Generator,
        noise: np.random.Generator,
    ) -> None:
        """Start with posture and target from the options, or sampled within the joint limits."""
        self._rng, self._limits = rng, (robot.lower, robot.upper)
        start, target = self._sampled(), self._sampled()
        self.goal = options.get("target", target).copy()
        self._targets = 1
        self.until = inf if "target" in options else TARGET_PERIOD - INSTANT
        robot.reset(options.get("posture", start), noise)

    def judge(
        self, info: dict[str, Any], error: float, tension: float, state: ObjectState | None
    ) -> Outcome:
        """Reward and success for the present target; then the next target if it is due."""
        reward, info["success"] = judged(error, tension)
        if info["time"] >= self.until:
            self.next_target()
        return reward, None

    def next_target(self) -> None:
        """Choose a new target."""
        self.goal = self._sampled()
        self._targets += 1
        self.until = self._targets * TARGET_PERIOD - INSTANT

    def _sampled(self) -> Floats:
        return self._sample(self._rng, *self._limits)

    def write_info(self, info: dict[str, Any], state: ObjectState | None) -> None:
        """Write nothing: this task has no entries of its own."""
