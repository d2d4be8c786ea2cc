"""Plans postures that grasp and lift a can (paper, sec. IV).

The pose of the can is known from the camera and the estimated angles of the neck. The hand
approaches with its open side first, thumb up and palm beside the can. Its rotation about the can's
axis is chosen by inverse kinematics.
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
    """Geometry of a grasp.

    Attributes:
        grip_site: the frame whose origin is brought to the can's axis.
        grip_depth: how far below the can's top marker it is gripped [m].
        approach: direction in which the hand approaches, in its own frame (3,).
        standoff: distance from the can at which the approach begins [m].
        lift: height by which the can is lifted [m].
        points: number of postures on each straight path, both ends included.
        tolerance: largest offset of a posture from the path if the can is reachable [m].
        tilt_weight: weight of a radian of tilt against a metre of offset [m/rad].
        rest_weight: weight of a radian away from `rest` against a metre of offset [m/rad].
        stiff: joints whose `rest_weight` is three times that of the others.
        rest: preferred angle of each joint [rad]; zero for joints left out.
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
    """Plan to grasp a can, the camera pointed at it.

    Attributes:
        grip: position of the grip point in the world (3,) [m].
        approach: postures (K, n) [rad] from the stand-off to the can.
        lift: postures (K, n) [rad] from the can upwards.
        reachable: whether all postures are within tolerance of their paths.
        worst: largest offset of a posture from its path [m].
    """

    grip: Floats
    approach: Floats
    lift: Floats
    reachable: bool
    worst: float


class GraspPlanner:
    """Plans grasps by inverse kinematics.

    Args:
        kinematics: of head and arm, n joints.
        camera: the camera's frame.
        neck: names of the joints that turn the camera.
        options: geometry of the grasp; the defaults if left out.

    Raises:
        AgentError: the options name an unknown joint.
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
        stiffness = np.array(
            [3.0 if joint in options.stiff else 1.0 for joint in kinematics.joints]
        )
        self._precision = (options.rest_weight * stiffness) ** 2
        self._rest = np.array([rest.get(joint, 0.0) for joint in kinematics.joints])

    def marker_in_world(self, pose_marker_in_camera: Floats, q: Floats) -> Floats:
        """Pose of a marker in the world.

        Args:
            pose_marker_in_camera: (4, 4).
            q: joint angles (n,) [rad] at which it was seen.

        Returns:
            Pose (4, 4).
        """
        return self._kinematics.pose(self._camera, q) @ pose_marker_in_camera

    def grip(self, q: Floats) -> Floats:
        """Position of the grip point in the world (3,) [m] at joint angles (n,) [rad]."""
        return np.asarray(self._kinematics.pose(self._options.grip_site, q)[:3, 3])

    def point_camera(self, point: Floats, q: Floats) -> Floats:
        """Turn the neck until the camera points at a point.

        Args:
            point: in the world (3,) [m].
            q: joint angles (n,) [rad]; those outside the neck stay.

        Returns:
            Joint angles (n,) [rad].
        """
        return self._kinematics.point_camera(self._camera, point, q, self._neck).q

    def plan(self, pose_can: Floats, q: Floats) -> GraspPlan:
        """Plan the approach to a can and its lift.

        Args:
            pose_can: pose of the marker on top of the can in the world (4, 4).
            q: present joint angles (n,) [rad]; the camera is turned from those of the neck.
        """
        options = self._options
        up = np.array([0.0, 0.0, 1.0])
        grip = pose_can[:3, 3] - options.grip_depth * up
        start = np.where(self._arm, self._rest, q)
        at_can, error = self._reach(grip, _upright(np.array([1.0, 0.0, 0.0])), start, turn=0.0)
        turned = self._kinematics.pose(options.grip_site, at_can)[:3, :3]
        rotation = _upright(-turned[:, 2])
        direction = rotation @ (np.array(options.approach) / np.linalg.norm(options.approach))
        shares = np.linspace(0.0, 1.0, options.points)
        path = grip - options.standoff * shares[:, None] * direction
        back, back_error = self._line(path, rotation, at_can)
        path = grip + options.lift * shares[:, None] * up
        lift, lift_error = self._line(path, rotation, at_can)
        worst = max(error, back_error, lift_error)
        approach = np.array([self.point_camera(grip, point) for point in back[::-1]])
        lift = np.array([self.point_camera(grip, point) for point in lift])
        return GraspPlan(grip, approach, lift, worst <= options.tolerance, worst)

    def hover(self, pose_can: Floats, offset: Floats, q: Floats) -> Floats:
        """Posture with the grip point beside a can.

        Args:
            pose_can: pose of the marker on top of the can in the world (4, 4).
            offset: from the grip point of the can, in the world (3,) [m].
            q: present joint angles (n,) [rad]; the camera is turned from those of the neck.

        Returns:
            Joint angles (n,) [rad], the camera pointed at the hand.
        """
        grip = pose_can[:3, 3] - self._options.grip_depth * np.array([0.0, 0.0, 1.0])
        start = np.where(self._arm, self._rest, q)
        forward = _upright(np.array([1.0, 0.0, 0.0]))
        return self.point_camera(
            grip + offset, self._reach(grip + offset, forward, start, turn=0.0)[0]
        )

    def _line(self, points: Floats, rotation: Floats, start: Floats) -> tuple[Floats, float]:
        """Postures (K, n) [rad] along points (K, 3) [m], and their largest offset [m]."""
        postures, worst = [], 0.0
        for point in points:
            start, error = self._reach(point, rotation, start, turn=1.0)
            postures.append(start)
            worst = max(worst, error)
        return np.array(postures), worst

    def _reach(
        self, point: Floats, rotation: Floats, start: Floats, turn: float
    ) -> tuple[Floats, float]:
        """Posture (n,) [rad] with the grip at a point (3,) [m], and its offset [m].

        ``turn`` weighs the rotation about the can's axis.
        """
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
    """Orientation (3, 3) of a hand, thumb up and fingers along ``forward`` made horizontal."""
    fingers = np.array([forward[0], forward[1], 0.0])
    fingers /= np.linalg.norm(fingers)
    up = np.array([0.0, 0.0, 1.0])
    return np.column_stack([up, np.cross(-fingers, up), -fingers])
