"""The hand itself in a frame, by a detector that needs no marker on it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats
from jmm_agent.vision.hand_detection import HandDetection, HandDetector, HandSkip
from jmm_agent.vision.hand_finder import Findings, Hand, HandFinder, HandMissed, HandSeen
from jmm_agent.vision.marker_detector import Detector
from jmm_agent.vision.pose_covariance import checked_covariance, checked_pose

NO_HAND = "the hand was not seen"

POSITION_NOISE = 0.005
"""Usual standard deviation of the position of a hand that is seen without a marker [m]."""

KINDS: Mapping[HandSkip, Literal["absent", "doubled", "mirrored", "unclear"]] = {
    HandSkip.DARK: "absent",
    HandSkip.NOT_SEEN: "absent",
    HandSkip.TWICE: "doubled",
    HandSkip.MIRRORED: "mirrored",
    HandSkip.UNCLEAR: "unclear",
    HandSkip.UNCERTAIN: "unclear",
}


class HandShape(HandFinder):
    """Finds the hand by its shape.

    Args:
        hand: finds the hand in frames.
        detector: finds the other markers in frames; None if there are none.
        kinematics: of all joints between camera and hand.
        camera: the camera's frame in the kinematics.

    Raises:
        AgentError: the kinematics have no such frame.
    """

    what = "hand"
    missing = NO_HAND

    def __init__(
        self,
        hand: HandDetector,
        detector: Detector | None,
        kinematics: ArmKinematics,
        camera: str,
    ) -> None:
        if hand.frame not in kinematics.frames:
            raise AgentError(
                f"The hand's detector finds the pose of {hand.frame!r}, which is no frame of this "
                f"robot; it has: {', '.join(kinematics.frames)}."
            )
        super().__init__(kinematics, hand.frame, camera, POSITION_NOISE)
        self._hand, self._detector = hand, detector

    def find_at(self, frame: np.ndarray, pose: Floats) -> Findings:
        """The hand in a frame; see `HandFinder`."""
        return Findings(self._found(frame, pose), None)

    def find_markers(self, frame: np.ndarray, q: Floats) -> Findings:
        """The other markers in a frame; they are searched only when they are asked for."""
        return Findings(None, {} if self._detector is None else self._detector.detect(frame).poses)

    @property
    def shows(self) -> Callable[[Floats], bool]:
        """Whether a frame shows the hand at a pose in the camera (4, 4)."""
        return self._hand.shows

    @property
    def around(self) -> Callable[[Floats], bool]:
        """The same: a hand is seen from all sides."""
        return self._hand.shows

    def _found(self, frame: np.ndarray, pose: Floats) -> Hand:
        """The hand in a frame. A black frame shows none, whatever the detector finds in it."""
        outcome: HandDetection | HandSkip = HandSkip.DARK
        if np.any(frame):
            outcome = self._hand.detect(frame, pose)
        if isinstance(outcome, HandSkip):
            return HandMissed(KINDS[outcome], f"{NO_HAND}: {outcome.value}")
        found = checked_pose(outcome.pose_hand_in_camera)
        return HandSeen(found, self.frames, checked_covariance(outcome.covariance))
