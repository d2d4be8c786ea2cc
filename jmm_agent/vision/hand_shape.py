"""The hand itself in a frame, by a detector that needs no marker on it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats
from jmm_agent.vision.hand_detection import (
    HandDetection,
    HandDetector,
    HandsDetector,
    HandSkip,
)
from jmm_agent.vision.hand_finder import Findings, Hand, HandFinder, HandMissed, HandSeen
from jmm_agent.vision.marker_detector import Detector
from jmm_agent.vision.own_hand import ExpectedPoses, OwnHand
from jmm_agent.vision.pose_covariance import checked_covariance, checked_pose

NO_HAND = "the hand was not seen"

POSITION_NOISE = 0.005
"""Usual standard deviation of the position of a hand that is seen without a marker [m]."""

KINDS: Mapping[HandSkip, Literal["absent", "doubled", "mirrored", "unclear"]] = {
    HandSkip.DARK: "absent",
    HandSkip.NOT_SEEN: "absent",
    HandSkip.TWICE: "doubled",
    HandSkip.ANOTHER: "absent",
    HandSkip.MIRRORED: "mirrored",
    HandSkip.UNCLEAR: "unclear",
    HandSkip.UNCERTAIN: "unclear",
}


class HandShape(HandFinder):
    """Finds the hand by its shape, and by how it moves where others are seen.

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
        self._own = OwnHand()
        self._before: ExpectedPoses | None = None

    def find_at(self, frame: np.ndarray, pose: Floats) -> Findings:
        """The hand in a frame if it is the only one; see `HandFinder`."""
        found = self._found(frame, pose)
        if isinstance(found, HandSkip):
            return Findings(_missed(found), None)
        hands = tuple(map(_checked, found))
        return Findings(self._seen(hands[0] if len(hands) == 1 else HandSkip.TWICE), None, hands)

    def chosen(self, found: Findings, q: Floats) -> Findings:
        """The own one of the hands that were found, see `OwnHand`."""
        if not found.hands:
            return found
        return found._replace(hand=self._seen(self._own.choose(found.hands, self._expected(q))))

    def follow(self, q: Floats) -> None:
        """See `HandFinder`; the first estimate with another map shows what it has changed."""
        if self._before is not None:
            self._own.map_changed(self._before, self._expected(q))
            self._before = None
        super().follow(q)

    def map_changed(self) -> None:
        """See `HandFinder`."""
        super().map_changed()
        if self._before is None and self._q is not None:
            self._before = self._expected(self._q)

    def reset(self) -> None:
        """Forget all frames and hands, as before a new episode."""
        super().reset()
        self._own.reset()
        self._before = None

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

    def _found(self, frame: np.ndarray, pose: Floats) -> tuple[HandDetection, ...] | HandSkip:
        """The hands in a frame. A black frame shows none, whatever the detector finds in it."""
        if not np.any(frame):
            return HandSkip.DARK
        if isinstance(self._hand, HandsDetector):
            return self._hand.hands(frame, pose) or HandSkip.NOT_SEEN
        found = self._hand.detect(frame, pose)
        return found if isinstance(found, HandSkip) else (found,)

    def _expected(self, q: Floats) -> ExpectedPoses:
        """What joint angles (n,) [rad] predict."""
        return ExpectedPoses(self.pose(q), self._kinematics.pose(self.frames[1], q))

    def _seen(self, outcome: HandDetection | HandSkip) -> Hand:
        if isinstance(outcome, HandSkip):
            return _missed(outcome)
        return HandSeen(outcome.pose_hand_in_camera, self.frames, outcome.covariance)


def _missed(skip: HandSkip) -> HandMissed:
    return HandMissed(KINDS[skip], f"{NO_HAND}: {skip.value}")


def _checked(found: HandDetection) -> HandDetection:
    """What a detector found, if it is a pose with a covariance."""
    pose = checked_pose(found.pose_hand_in_camera)
    return HandDetection(pose, checked_covariance(found.covariance))
