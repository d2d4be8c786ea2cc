"""From a can that was seen to the postures that grasp and lift it (paper, sec. IV).

The can's pose comes from the camera and the estimated neck. The hand comes from its open side,
thumb up, palm beside the can; how it is turned about the can's axis is left to the joints.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats


@dataclass(frozen=True)
class GraspOptions:
    """How a can is approached.

    Attributes:
        grip_site: the frame whose origin is brought to the can's axis.
        grip_depth: how far below the can's top marker it is gripped [m].
        approach: direction in the hand's frame in which the hand comes; (3,).
        standoff: distance from which it comes [m].
        lift: how high the can is lifted [m].
        points: postures on the straight way, at both ends included.
        tolerance: largest offset of a planned point from where it should be [m].
        tilt_weight: weight of a radian of tilt against a metre of offset [m/rad].
        rest_weight: weight of a radian away from `rest` against a metre of offset [m/rad].
        stiff: joints that move a third as willingly as the others.
        rest: comfortable angles by joint [rad]; joints left out rest at zero.
    """

    grip_site: str = "grip"
    grip_depth: float = 0.047
    approach: tuple[float, float, float] = (0.0, 0.94, -0.33)
    standoff: float = 0.11
    lift: float = 0.10
    points: int = 6
    tolerance: float = 0.015
    tilt_weight: float = 0.2
    rest_weight: float = 0.01
    stiff: tuple[str, ...] = ("sc_roll", "sc_yaw", "ac_roll", "ac_pitch", "wrist_dev")
    rest: tuple[tuple[str, float], ...] = (
        ("sc_roll", -0.17),
        ("sh_pitch", -0.45),
        ("sh_roll", -0.35),
        ("sh_yaw", 0.25),
        ("elbow", 1.2),
    )


class GraspPlan(NamedTuple):
    """Ways to grasp a can; angles [rad], the neck turned to the can.

    Attributes:
        grip: where the grip point goes in the world (3,) [m].
        approach: postures (K, n) from the stand-off to the can.
        lift: postures (K, n) from the can upwards.
        reachable: whether inverse kinematics came close enough to every point of both.
        worst: largest offset of a point that was planned from where it should be [m].
    """

    grip: Floats
    approach: Floats
    lift: Floats
    reachable: bool
    worst: float


class GraspPlanner:
    """Plans grasps by inverse kinematics.

    Args:
        kinematics: of head and arm.
        camera: the camera's frame.
        neck: names of the joints that turn the camera.
    """

    def __init__(
        self,
        kinematics: ArmKinematics,
        camera: str,
        neck: tuple[str, ...],
        options: GraspOptions | None = None,
    ) -> None:
        self._kinematics, self._camera = kinematics, camera
        self._options = options = options or GraspOptions()
        self._arm = np.array([joint not in neck for joint in kinematics.joints])
        self._neck = tuple(joint for joint in neck if joint != "neck_roll")
        rest = dict(options.rest)
        unknown = [joint for joint in rest if joint not in kinematics.joints]
        if unknown:
            raise AgentError(f"Grasp: unknown joint {unknown[0]!r}; joints: {kinematics.joints}.")
        willing = np.array([3.0 if joint in options.stiff else 1.0 for joint in kinematics.joints])
        self._precision = (options.rest_weight * willing) ** 2
        self._rest = np.array([rest.get(joint, 0.0) for joint in kinematics.joints])

    def marker_in_world(self, pose_marker_in_camera: Floats, q: Floats) -> Floats:
        """Pose (4, 4) in the world of a marker seen from the posture ``q`` (n,) [rad]."""
        return self._kinematics.pose(self._camera, q) @ pose_marker_in_camera

    def look_at(self, point: Floats, q: Floats) -> Floats:
        """``q`` (n,) [rad] with the neck turned such that the camera looks at a point (3,) [m]."""
        return self._kinematics.look_at(self._camera, point, q, self._neck).q

    def plan(self, pose_can: Floats, q: Floats) -> GraspPlan:
        """Ways to a can whose top marker has the pose ``pose_can`` (4, 4) in the world.

        Args:
            q: present angles (n,) [rad]; the neck's are where the search for its turn starts.
        """
        options = self._options
        up = np.array([0.0, 0.0, 1.0])
        grip = pose_can[:3, 3] - options.grip_depth * up
        start = np.where(self._arm, self._rest, q)
        at_can, error = self._reach(grip, _upright(np.array([1.0, 0.0, 0.0])), start, turn=0.0)
        turned = self._kinematics.pose(options.grip_site, at_can)[:3, :3]
        rotation = _upright(-turned[:, 2])
        way = rotation @ (np.array(options.approach) / np.linalg.norm(options.approach))
        shares = np.linspace(0.0, 1.0, options.points)
        coming = grip - options.standoff * shares[:, None] * way
        back, back_error = self._line(coming, rotation, at_can)
        rising = grip + options.lift * shares[:, None] * up
        lift, lift_error = self._line(rising, rotation, at_can)
        worst = max(error, back_error, lift_error)
        approach = np.array([self.look_at(grip, point) for point in back[::-1]])
        lift = np.array([self.look_at(grip, point) for point in lift])
        return GraspPlan(grip, approach, lift, worst <= options.tolerance, worst)

    def hover(self, pose_can: Floats, offset: Floats, q: Floats) -> Floats:
        """A posture (n,) [rad] with the grip point ``offset`` (3,) [m] off the can's grip point."""
        grip = pose_can[:3, 3] - self._options.grip_depth * np.array([0.0, 0.0, 1.0])
        start = np.where(self._arm, self._rest, q)
        forward = _upright(np.array([1.0, 0.0, 0.0]))
        return self.look_at(grip + offset, self._reach(grip + offset, forward, start, turn=0.0)[0])

    def _line(self, points: Floats, rotation: Floats, start: Floats) -> tuple[Floats, float]:
        postures, worst = [], 0.0
        for point in points:
            start, error = self._reach(point, rotation, start, turn=1.0)
            postures.append(start)
            worst = max(worst, error)
        return np.array(postures), worst

    def _reach(
        self, point: Floats, rotation: Floats, start: Floats, turn: float
    ) -> tuple[Floats, float]:
        """Posture with the grip at a point; ``turn`` weighs its turn about the can's axis."""
        options = self._options
        target = np.eye(4)
        target[:3, :3], target[:3, 3] = rotation, point
        tilt = options.tilt_weight**2
        found = self._kinematics.solve(
            options.grip_site,
            target,
            start,
            weights=(1.0, 1.0, 1.0, turn * tilt, tilt, tilt),
            prior_precision=self._precision,
            free=self._arm,
        )
        reached = self._kinematics.pose(options.grip_site, found.q)[:3, 3]
        return found.q, float(np.linalg.norm(reached - point))


def _upright(forward: Floats) -> Floats:
    """Orientation of a hand with its thumb up and its fingers along ``forward``, made level."""
    fingers = np.array([forward[0], forward[1], 0.0])
    fingers /= np.linalg.norm(fingers)
    up = np.array([0.0, 0.0, 1.0])
    return np.column_stack([up, np.cross(-fingers, up), -fingers])
