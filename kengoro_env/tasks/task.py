"""Interface of a task."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from kengoro_env.robot.fingers import FINGERS
from kengoro_env.robot.robot import Robot
from kengoro_env.stepping.tracked_object import ObjectState
from kengoro_env.types import Floats

Outcome = tuple[float, str | None]
"""Bounded reward of a control step, and the reason why the episode ended; None: it goes on."""


class Task(Protocol):
    """A goal for the robot in a scene.

    Attributes:
        scene: MJCF file below assets/.
        has_camera: whether the scene has the camera in the head.
        fingers: whether the last entry of an action commands the fingers.
        options: names and lengths of the options of `start` beside ``posture``; the length None
            stands for the number of joints.
        shows_target: whether the goal is observed as ``target``.
        goal: joint angles to reach now (n,) [rad], an array that is never written to; None: none.
        object_name: name of the body that the hand is to lift; None: no object.
        elements: what a user's model needs beside joints and muscles, each a kind and a name.
    """

    scene: str
    has_camera: bool
    fingers: bool
    options: Mapping[str, int | None]
    shows_target: bool
    goal: Floats | None
    object_name: str | None
    elements: Sequence[tuple[str, str]]

    def start(
        self,
        robot: Robot,
        options: Mapping[str, Floats],
        rng: np.random.Generator,
        noise: np.random.Generator,
    ) -> None:
        """Reset the robot and choose the goal.

        Args:
            robot: the robot.
            options: checked values of ``posture`` and of `options`.
            rng: generator of posture and goal.
            noise: generator of the sensors' noise.
        """

    def write_info(self, info: dict[str, Any], state: ObjectState | None) -> None:
        """Write the entries of this task into ``info``; called after each start.

        Args:
            info: the truth about the robot.
            state: state of the object; None without an object.
        """

    def judge(
        self, info: dict[str, Any], error: float, tension: float, state: ObjectState | None
    ) -> Outcome:
        """Reward of the present state; called once after each control step.

        Args:
            info: the truth about the robot; receives ``success``, whether the goal is reached now,
                and the entries of `write_info`.
            error: mean square error of the joint angles [rad^2]; 0 without a goal.
            tension: mean tension of the muscles [N].
            state: state of the object; None without an object.
        """


def entries_of(task: Task, muscles: Sequence[str]) -> tuple[str, ...]:
    """Names of the entries of an action: the muscles, then the fingers if they are commanded."""
    return (*muscles, FINGERS) if task.fingers else tuple(muscles)
