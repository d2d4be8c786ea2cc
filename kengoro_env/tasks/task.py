"""What an environment needs to know of a task."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from kengoro_env.body import Moment
from kengoro_env.robot import Robot

Array = NDArray[np.float64]


class Outcome(NamedTuple):
    """What a control step came to.

    Attributes:
        reward: for a learner, bounded.
        success: whether the goal is reached now.
        ended: why the episode is over; None while it goes on.
    """

    reward: float
    success: bool
    ended: str | None = None


class Task(Protocol):
    """A goal for the robot in a scene.

    Attributes:
        scene: its MJCF file, below assets/.
        has_camera: whether the scene has the camera in the head.
        fingers: whether the last entry of an action closes the fingers.
        options: names of the options that `start` takes beside ``posture``, and their lengths;
            None stands for the number of joints.
        shows_target: whether ``target`` is observed.
    """

    scene: str
    has_camera: bool
    fingers: bool
    options: Mapping[str, int | None]
    shows_target: bool

    def start(
        self,
        robot: Robot,
        options: Mapping[str, Array],
        rng: np.random.Generator,
        noise: np.random.Generator,
    ) -> None:
        """Reset the robot, whose sensors draw from ``noise``, and choose the goal from ``rng``."""

    def target(self) -> Array:
        """Joint angles to reach (n,) [rad]; only where ``shows_target``."""

    def judge(self, robot: Robot, now: Moment) -> Outcome:
        """Judge the present state, measured as ``now``; called once after each control step."""

    def truth(self, robot: Robot) -> dict[str, Any]:
        """Entries for ``info`` beside those that every task has."""
