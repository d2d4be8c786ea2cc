"""The marker on the hand: where the kinematics expect it, and where a frame shows it."""

from __future__ import annotations

import numpy as np

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats
from jmm_agent.vision.marker_detector import Detections, Detector, MarkerPose, Skip


class HandMarker:
    """Finds the hand's marker in camera frames (paper, sec. III-C, step 1).

    Args:
        detector: finds markers in frames.
        kinematics: of all joints between camera and marker.
        number: id of the hand's marker.
        camera: the camera's frame in the kinematics.
        site: the site that carries the marker.
    """

    def __init__(
        self, detector: Detector, kinematics: ArmKinematics, number: int, camera: str, site: str
    ) -> None:
        self._detector, self._kinematics = detector, kinematics
        self._number, self._camera, self._site = number, camera, site

    def pose(self, q: Floats) -> Floats:
        """Expected pose_marker_in_camera (4, 4) at joint angles (n,) [rad]."""
        return self._kinematics.pose(self._site, q, relative_to=self._camera)

    def detect(self, frame: np.ndarray, q: Floats) -> Detections:
        """All markers in a frame.

        Args:
            frame: (H, W, 3) uint8.
            q: estimated joint angles (n,) [rad]; they predict the pose of the hand's marker.

        Raises:
            AgentError: the frame has a wrong shape or type.
        """
        return self._detector.detect(frame, {self._number: self.pose(q)})

    def find(self, frame: np.ndarray, q: Floats) -> MarkerPose | Skip:
        """The hand's marker in a frame, or why it has no pose; see `detect`."""
        found = self.detect(frame, q)
        if self._number in found.poses:
            return found.poses[self._number]
        return found.skips[self._number]
