"""What an environment needs to know of a task."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from kengoro_env.robot.robot import Robot
from kengoro_env.stepping.lift_monitor import Sight
from kengoro_env.types import Floats

Outcome = tuple[float, str | None]
"""What a control step came to: a bounded reward for a learner, and why the episode is over, None
while it goes on."""


class Task(Protocol):
    """A goal for the robot in a scene.

    Attributes:
        scene: its MJCF file, below assets/.
        has_camera: whether the scene has the camera in the head.
        fingers: whether the last entry of an action closes the fingers.
        options: names of the options that `start` takes beside ``posture``, and their lengths;
            None stands for the number of joints.
        shows_target: whether ``target``, which is the goal, is observed.
        goal: joint angles to reach now (n,) [rad], an array that nobody writes to; None for none.
        thing: what the hand is to lift, a body's name; None for nothing.
    """

    scene: str
    has_camera: bool
    fingers: bool
    options: Mapping[str, int | None]
    shows_target: bool
    goal: Floats | None
    thing: str | None

    def start(
        self,
        robot: Robot,
        options: Mapping[str, Floats],
        rng: np.random.Generator,
        noise: np.random.Generator,
    ) -> None:
        """Reset the robot, whose sensors draw from ``noise``, and choose the goal from ``rng``."""

    def tell(self, info: dict[str, Any], sight: Sight | None) -> None:
        """Write into ``info`` what only this task knows; called after each start."""

    def judge(
        self, info: dict[str, Any], error: float, tension: float, sight: Sight | None
    ) -> Outcome:
        """Judge the present state; called once after each control step.

        Args:
            info: the truth about the robot now; gets ``success``, whether the goal is reached now,
                and what `tell` writes.
            error: mean square error of its joint angles [rad^2]; 0 without a goal.
            tension: mean of its wires [N].
            sight: what is true of the thing; None where there is none.
        """
