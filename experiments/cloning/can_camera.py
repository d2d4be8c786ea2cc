"""Where the can stands, as the camera in the head measures it by the can's marker.

It is measured once, in the frame of the start, where every robot stands in the same posture. Camera
and bones are believed to be those of the nominal model: a policy has learned nothing of its robot.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats
from jmm_agent.vision.marker_detector import MarkerDetector
from kengoro.hand_search import READY
from kengoro.robots import CAMERA, CAN, SIDES, make_env
from kengoro.trained_maps import ARM
from kengoro_env.assets import asset_path
from kengoro_env.departures.camera import EYE
from kengoro_env.names import JOINTS
from kengoro_env.tasks.can_grasp import CAN_AREA

CanSource = Literal["state", "camera"]
"""Whether policies are given the true position of the can, or the one that the camera measures."""
MIDDLE = CAN_AREA.mean(axis=1)
"""Position that a policy is given where the camera does not see the can, shape (2,) [m]."""


class CanCamera:
    """Measures the can of a robot.

    Args:
        robot: seed of the actual robot; None: the drawing.
    """

    def __init__(self, robot: int | None) -> None:
        self._env = make_env("CanGrasp", robot, camera=True)
        self._detector = MarkerDetector(CAMERA, {CAN: SIDES[CAN]})
        self._pose_camera = ArmKinematics(asset_path(ARM), JOINTS).pose(EYE, np.array(READY))

    def measured(self, seed: int) -> Floats | None:
        """Horizontal position of the can's marker in the frame of the start of an episode.

        Args:
            seed: of the episode.

        Returns:
            Shape (2,) [m]; None if the marker is not seen.
        """
        observation, _ = self._env.reset(seed=seed, options={"posture": np.array(READY)})
        return self.position(observation["frame"])

    def position(self, frame: np.ndarray) -> Floats | None:
        """Position of the marker in a frame (480, 640, 3) of the start, as `measured`."""
        found = self._detector.detect(frame).poses.get(CAN)
        if found is None:
            return None
        position: Floats = (self._pose_camera @ found.pose_marker_in_camera)[:2, 3]
        return position

    def close(self) -> None:
        """Close the environment."""
        self._env.close()
