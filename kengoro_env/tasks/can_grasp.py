"""Can grasping: take a can from the table and lift it (paper, sec. IV).

The reward of a step lies in [0, 1]: a third for the grip point's distance to the can,
exp(-distance / REACH_SCALE), a third for holding the can between fingers and thumb or palm, and a
third for how far it rises while it is held, up to `LIFT_HEIGHT`. Success is what `LiftMonitor`
sees: lifted 30 mm for 1 s by nothing but the hand's contact. Success does not end the episode, so
that a learner gains by holding on; a can that falls off the table does.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import exp, radians
from typing import Any

import mujoco
import numpy as np

from kengoro_env.departures.sensors import EYE
from kengoro_env.errors import KengoroError
from kengoro_env.postures import posture_set
from kengoro_env.robot.robot import Robot
from kengoro_env.stepping.lift_monitor import LIFT_HEIGHT, LiftMonitor, Sight, TrackedObject
from kengoro_env.tasks.task import Outcome
from kengoro_env.types import Floats

CAN = "can"
"""Name of its body, joint and geom."""

CAN_AREA = np.array([[0.36, 0.44], [-0.20, -0.10]])
"""Where the can is put, x and y of its axis [m], uniformly."""

START_DISTANCE = 0.25
"""The arm starts with its grip point at least this far from the can's centre [m]."""

CLEAR_VIEW = radians(20.0)
"""... and its marker at least this far from the eye's line to the can [rad]."""

REACH_SCALE = 0.15
FALLEN = 0.10
"""A can this far below where it stood has left the table [m]."""

HAND_SIZE = 0.16
"""Nobody puts the can back with the grip point closer than this [m]."""

FALLEN_TIME = 10.0
"""So long it may lie there before the episode ends, unless somebody puts it back [s]."""


class CanGrasp:
    """The task of ``Kengoro/CanGrasp-v0``."""

    scene = "mjcf/kengoro_arm/can_grasp.xml"
    has_camera = True
    fingers = True
    options: Mapping[str, int | None] = {"can": 2}
    shows_target = False
    thing: str | None = CAN
    goal: Floats | None = None

    def start(
        self,
        robot: Robot,
        options: Mapping[str, Floats],
        rng: np.random.Generator,
        noise: np.random.Generator,
    ) -> None:
        """Put the can on the table and the arm away from it, at a posture of the posture set."""
        drawn = rng.uniform(*CAN_AREA.T)
        place = options.get("can", drawn)
        self._check_place(robot, place)
        postures = posture_set()
        self._can = TrackedObject(robot.model, CAN)
        while True:
            posture = options.get("posture", postures[rng.integers(len(postures))])
            robot.reset(posture, noise)
            can = robot.data.joint(CAN)
            can.qpos[:2] = place
            mujoco.mj_forward(robot.model, robot.data)
            if "posture" in options or self._is_clear(robot):
                break
        self._stood = can.qpos.copy()
        self._on_table = robot.time
        self._monitor = LiftMonitor(self._can.look(robot.data), robot.time)

    def tidy_up(self, robot: Robot) -> None:
        """Put the can back where it stood, unless the hand is there."""
        if np.linalg.norm(robot.site_pose("grip")[:3, 3] - self._stood[:3]) < HAND_SIZE:
            return
        can = robot.data.joint(CAN)
        can.qpos[:], can.qvel[:] = self._stood, 0.0
        mujoco.mj_forward(robot.model, robot.data)
        self._monitor.reset(self._can.look(robot.data), robot.time)

    def _check_place(self, robot: Robot, place: Floats) -> None:
        table, can = robot.model.geom("table_top"), robot.model.geom(CAN)
        centre = robot.model.body("table").pos[:2]
        if np.any(np.abs(place - centre) > table.size[:2] - can.size[0]):
            low, high = centre - table.size[:2], centre + table.size[:2]
            raise KengoroError(
                f"the can cannot stand at ({place[0]:g}, {place[1]:g}) m: the table reaches from "
                f"({low[0]:g}, {low[1]:g}) to ({high[0]:g}, {high[1]:g}) m"
            )

    def _is_clear(self, robot: Robot) -> bool:
        """Whether the hand is away from the can, and from the eye's view of it."""
        eye = robot.data.camera(EYE).xpos
        views = [robot.data.site(name).xpos - eye for name in ("marker_hand", "marker_can")]
        hand, can = (view / np.linalg.norm(view) for view in views)
        distance = self._can.look(robot.data).distance
        return distance > START_DISTANCE and bool(hand @ can < np.cos(CLEAR_VIEW))

    def judge(
        self, info: dict[str, Any], error: float, tension: float, sight: Sight | None
    ) -> Outcome:
        """Reward and success now, and whether the can has left the table."""
        assert sight is not None
        monitor = self._monitor
        monitor.update(sight, info["time"])
        reach = exp(-sight.distance / REACH_SCALE)
        lift = min(max(monitor.rise / LIFT_HEIGHT, 0.0), 1.0) if monitor.grasped else 0.0
        reward = (reach + float(monitor.grasped) + lift) / 3.0
        if monitor.rise > -FALLEN:
            self._on_table = info["time"]
        fallen = info["time"] - self._on_table > FALLEN_TIME
        ended = "the can fell off the table" if fallen else None
        info["success"] = monitor.lifted
        self.tell(info, sight)
        return reward, ended

    def tell(self, info: dict[str, Any], sight: Sight | None) -> None:
        """Pose of the can (4, 4), whether the hand holds it, and how far it has risen [m]."""
        assert sight is not None
        info["can_pose"] = sight.pose
        info["grasped"] = self._monitor.grasped
        info["rise"] = self._monitor.rise
