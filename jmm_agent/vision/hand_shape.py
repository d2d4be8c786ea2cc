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
        hands = tuple(_checked(one, self._hand) for one in found)
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
            hands: object = self._hand.hands(frame, pose)
            if isinstance(hands, HandSkip):
                return hands
            if not isinstance(hands, tuple | list):
                raise _wrong_result(self._hand, "hands", type(hands).__name__)
            return tuple(hands) or HandSkip.NOT_SEEN
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


def _wrong_result(hand: HandDetector, method: str, found: str) -> AgentError:
    wanted = "a tuple of HandDetections" if method == "hands" else "a HandDetection"
    return AgentError(
        f"The hand's detector {type(hand).__name__} returned {found} from {method}, but must "
        f"return {wanted} or a HandSkip."
    )


def _checked(found: object, hand: HandDetector) -> HandDetection:
    """What a detector found, if it is a pose before the camera with a covariance."""
    if not isinstance(found, HandDetection):
        kind = type(found).__name__
        if isinstance(hand, HandsDetector):
            raise _wrong_result(hand, "hands", f"a tuple with {kind}")
        raise _wrong_result(hand, "detect", kind)
    pose = checked_pose(found.pose_hand_in_camera)
    if not pose[2, 3] > 0.0:
        raise AgentError(
            f"The hand's detector {type(hand).__name__} found the hand at z = {pose[2, 3]:.3g} m "
            "in the camera, but a hand that is seen is before the camera: z points forward and is "
            "positive."
        )
    return HandDetection(pose, checked_covariance(found.covariance))
