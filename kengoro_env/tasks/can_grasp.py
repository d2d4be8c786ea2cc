"""Can grasping: take a can from the table and lift it (paper, sec. IV).

The reward of a step lies in [0, 1]: a third for the grip point's distance to the can,
exp(-distance / REACH_SCALE), a third for holding the can between fingers and thumb or palm, and a
third for its rise while it is held, up to `LIFT_HEIGHT`. Success is decided by `LiftMonitor`: the
can is lifted by 30 mm for 1 s by contact with the hand alone. Success does not end the episode, so
that holding on is rewarded; the fall of the can off the table does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import exp, radians
from typing import Any

import mujoco
import numpy as np

from kengoro_env.departures.camera import EYE
from kengoro_env.errors import ArgumentError
from kengoro_env.postures import postures_within
from kengoro_env.robot.fingers import FINGERS
from kengoro_env.robot.robot import Robot
from kengoro_env.stepping.tracked_object import ObjectState, TrackedObject
from kengoro_env.tasks.lift_monitor import LIFT_HEIGHT, LiftMonitor
from kengoro_env.tasks.task import Outcome
from kengoro_env.types import Floats

CAN = "can"
"""Name of the can's body, joint and geom."""

CAN_AREA = np.array([[0.36, 0.44], [-0.20, -0.10]])
"""Box from which x and y of the can's axis are sampled [m]."""

START_DISTANCE = 0.25
"""Smallest distance of the grip point from the can's centre at the start [m]."""

CLEAR_VIEW = radians(20.0)
"""Smallest angle between marker and can at the start, seen from the camera [rad]."""

REACH_SCALE = 0.15
"""Distance at which the reward for the distance has fallen to 1/e [m]."""

FALLEN = 0.10
"""Depth below its start at which the can has left the table [m]."""

HAND_SIZE = 0.16
"""Smallest distance of the grip point from the can's place for putting it back [m]."""

FALLEN_TIME = 10.0
"""Time after which a fallen can that is not put back ends the episode [s]."""


class CanGrasp:
    """The task of ``Kengoro/CanGrasp-v0``."""

    scene = "mjcf/kengoro_arm/can_grasp.xml"
    has_camera = True
    fingers = True
    options: Mapping[str, int | None] = {"can": 2}
    shows_target = False
    object_name: str | None = CAN
    elements: Sequence[tuple[str, str]] = (
        ("actuator", FINGERS), ("body", CAN), ("joint", CAN), ("geom", CAN), ("body", "table"),
        ("geom", "table_top"), ("body", "hand"), ("body", "fingers_proximal"), ("camera", EYE),
        ("site", "grip"), ("site", "marker_hand"), ("site", "marker_can"),
    )  # fmt: skip
    goal: Floats | None = None

    def start(
        self,
        robot: Robot,
        options: Mapping[str, Floats],
        rng: np.random.Generator,
        noise: np.random.Generator,
    ) -> None:
        """Put the can on the table, and the arm at a posture of the posture set away from it."""
        sampled = rng.uniform(*CAN_AREA.T)
        position = options.get("can", sampled)
        self._check_on_table(robot, position)
        postures = postures_within(robot.lower, robot.upper)
        self._can = TrackedObject(robot.model, CAN)
        while True:
            posture = options.get("posture", postures[rng.integers(len(postures))])
            robot.reset(posture, noise)
            can = robot.data.joint(CAN)
            can.qpos[:2] = position
            mujoco.mj_forward(robot.model, robot.data)
            if "posture" in options or self._is_clear(robot):
                break
        self._stood = can.qpos.copy()
        self._on_table = robot.time
        self._monitor = LiftMonitor(self._can.observe(robot.data), robot.time)

    def put_can_back(self, robot: Robot) -> None:
        """Put the can back where it stood, unless the hand is there."""
        if np.linalg.norm(robot.site_pose("grip")[:3, 3] - self._stood[:3]) < HAND_SIZE:
            return
        can = robot.data.joint(CAN)
        can.qpos[:], can.qvel[:] = self._stood, 0.0
        mujoco.mj_forward(robot.model, robot.data)
        self._monitor.reset(self._can.observe(robot.data), robot.time)

    def _check_on_table(self, robot: Robot, position: Floats) -> None:
        table, can = robot.model.geom("table_top"), robot.model.geom(CAN)
        centre = robot.model.body("table").pos[:2]
        if np.any(np.abs(position - centre) > table.size[:2] - can.size[0]):
            low, high = centre - table.size[:2], centre + table.size[:2]
            raise ArgumentError(
                f"the can cannot stand at ({position[0]:g}, {position[1]:g}) m: the table reaches "
                f"from ({low[0]:g}, {low[1]:g}) to ({high[0]:g}, {high[1]:g}) m"
            )

    def _is_clear(self, robot: Robot) -> bool:
        """Whether the hand is away from the can, and does not hide it from the camera."""
        eye = robot.data.camera(EYE).xpos
        views = [robot.data.site(name).xpos - eye for name in ("marker_hand", "marker_can")]
        hand, can = (view / np.linalg.norm(view) for view in views)
        distance = self._can.observe(robot.data).distance
        return distance > START_DISTANCE and bool(hand @ can < np.cos(CLEAR_VIEW))

    def judge(
        self, info: dict[str, Any], error: float, tension: float, state: ObjectState | None
    ) -> Outcome:
        """Reward and success; the episode ends some time after the can has left the table."""
        assert state is not None
        monitor = self._monitor
        monitor.update(state, info["time"])
        reach = exp(-state.distance / REACH_SCALE)
        lift = min(max(monitor.rise / LIFT_HEIGHT, 0.0), 1.0) if monitor.grasped else 0.0
        reward = (reach + float(monitor.grasped) + lift) / 3.0
        if monitor.rise > -FALLEN:
            self._on_table = info["time"]
        fallen = info["time"] - self._on_table > FALLEN_TIME
        ended = "the can fell off the table" if fallen else None
        info["success"] = monitor.lifted
        self.write_info(info, state)
        return reward, ended

    def write_info(self, info: dict[str, Any], state: ObjectState | None) -> None:
        """Write ``can_pose`` (4, 4), ``grasped`` and ``rise`` [m]."""
        assert state is not None
        info["can_pose"] = state.pose
        info["grasped"] = self._monitor.grasped
        info["rise"] = self._monitor.rise
