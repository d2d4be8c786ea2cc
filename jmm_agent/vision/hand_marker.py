"""The marker on the hand: where the kinematics expect it, and where a frame shows it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats
from jmm_agent.vision.hand_finder import Findings, Hand, HandFinder, HandMissed, HandSeen
from jmm_agent.vision.marker_detector import Detections, Detector, MarkerPose, Skip
from jmm_agent.vision.marker_in_view import PredictingDetector

NO_MARKER = "the hand's marker was not seen"


class HandMarker(HandFinder):
    """Finds the hand by the marker on it.

    Args:
        detector: finds markers in frames.
        kinematics: of all joints between camera and marker.
        number: id of the hand's marker.
        camera: the camera's frame in the kinematics.
        site: the site that carries the marker.
        position_noise: standard deviation of the marker's position [m].
    """

    what = "marker"
    missing = NO_MARKER

    def __init__(
        self,
        detector: Detector,
        kinematics: ArmKinematics,
        number: int,
        camera: str,
        site: str,
        position_noise: float,
    ) -> None:
        super().__init__(kinematics, site, camera, position_noise)
        self._detector, self._number = detector, number

    def find_at(self, frame: np.ndarray, pose: Floats) -> Findings:
        """All markers in a frame, and the hand's; see `HandFinder`."""
        found = self._detector.detect(frame, {self._number: pose})
        return Findings(self._hand(found), found.poses)

    @property
    def shows(self) -> Callable[[Floats], bool] | None:
        """Whether a frame shows the hand's marker at a pose in the camera (4, 4); None: unknown."""
        if not isinstance(self._detector, PredictingDetector):
            return None
        return partial(self._detector.shows, self._number)

    def _hand(self, found: Detections) -> Hand:
        if self._number in found.poses:
            return hand_of(found.poses[self._number])
        twice = found.skips.get(self._number) is Skip.TWICE
        return HandMissed("doubled" if twice else "absent", NO_MARKER)


def hand_of(marker: MarkerPose) -> HandSeen:
    """The hand by its marker.

    Args:
        marker: on the hand.
    """
    edges = np.roll(marker.corners_px, 1, axis=0) - marker.corners_px
    side = float(np.hypot(edges[:, 0], edges[:, 1]).max())
    pose = marker.pose_marker_in_camera
    return HandSeen(pose, flipped=marker.flipped_in_camera, side_px=side)
