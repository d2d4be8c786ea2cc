"""The hand in a frame without a marker: what a detector finds, and what the agent makes of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.vision.hand_detection import HandDetection, HandSkip
from jmm_agent.vision.hand_finder import HandMissed, HandSeen
from jmm_agent.vision.hand_shape import HandShape
from jmm_agent.vision.marker_detector import Detections, MarkerPose
from tests.jmm_agent.nominal_arm import posture_set

CAN = 1
Q = posture_set()[0]
FRAME = np.full((4, 4, 3), 90, dtype=np.uint8)
COVARIANCE = np.diag([1e-6, 1e-6, 9e-6, 1e-4, 1e-4, 1e-4])


class FixedHand:
    """Returns the same for all frames, and records what was expected."""

    frame = "hand"

    def __init__(self, outcome: HandDetection | HandSkip) -> None:
        self.outcome, self.calls = outcome, 0
        self.expected: np.ndarray | None = None

    def detect(
        self, frame_rgb: np.ndarray, expected: np.ndarray | None = None
    ) -> HandDetection | HandSkip:
        self.expected, self.calls = expected, self.calls + 1
        return self.outcome

    def shows(self, pose: np.ndarray) -> bool:
        return bool(pose[2, 3] > 0.0)


class CanDetector:
    """Finds the marker of the can only."""

    def __init__(self) -> None:
        self.calls = 0

    def detect(self, frame_rgb: np.ndarray, expected: object = None) -> Detections:
        self.calls += 1
        return Detections(
            {CAN: MarkerPose(CAN, np.eye(4), np.zeros((4, 2)), 0.1, np.eye(4), 9.0)}, {}, ()
        )


def pose_at(*position: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = position
    return pose


def test_the_pose_is_that_of_the_hand_in_the_camera_with_its_covariance(arm: ArmKinematics) -> None:
    hand = FixedHand(HandDetection(pose_at(0.1, 0.0, 0.5), COVARIANCE))
    found = HandShape(hand, None, arm, "eye").find(FRAME, Q).hand
    assert isinstance(found, HandSeen)
    np.testing.assert_array_equal(found.pose, pose_at(0.1, 0.0, 0.5))
    np.testing.assert_array_equal(found.covariance, COVARIANCE)
    assert found.frames == ("hand", "eye")
    assert hand.expected is not None
    predicted = np.linalg.inv(arm.pose("eye", Q)) @ arm.pose("hand", Q)
    np.testing.assert_allclose(hand.expected, predicted, atol=1e-12)


@pytest.mark.parametrize(
    ("skip", "kind"),
    [
        (HandSkip.DARK, "absent"),
        (HandSkip.NOT_SEEN, "absent"),
        (HandSkip.TWICE, "doubled"),
        (HandSkip.MIRRORED, "mirrored"),
        (HandSkip.UNCLEAR, "unclear"),
        (HandSkip.UNCERTAIN, "unclear"),
    ],
)
def test_a_hand_without_a_pose_has_a_reason(arm: ArmKinematics, skip: HandSkip, kind: str) -> None:
    found = HandShape(FixedHand(skip), None, arm, "eye").find(FRAME, Q).hand
    assert isinstance(found, HandMissed)
    assert found.kind == kind
    assert skip.value in found.reason


def test_every_skip_has_a_kind() -> None:
    from jmm_agent.vision.hand_shape import KINDS

    assert set(KINDS) == set(HandSkip)


def test_a_black_frame_shows_no_hand_whatever_a_detector_finds(arm: ArmKinematics) -> None:
    hand = FixedHand(HandDetection(pose_at(0.1, 0.0, 0.5), COVARIANCE))
    found = HandShape(hand, None, arm, "eye").find(np.zeros_like(FRAME), Q).hand
    assert isinstance(found, HandMissed)
    assert HandSkip.DARK.value in found.reason
    assert hand.calls == 0


def test_other_markers_are_searched_only_when_they_are_asked_for(arm: ArmKinematics) -> None:
    hand, cans = FixedHand(HandSkip.NOT_SEEN), CanDetector()
    finder = HandShape(hand, cans, arm, "eye")
    assert finder.find(FRAME, Q).markers is None
    assert cans.calls == 0
    found = finder.find_markers(FRAME, Q)
    assert found.hand is None
    assert found.markers is not None
    assert list(found.markers) == [CAN]
    assert hand.calls == 1
    assert HandShape(hand, None, arm, "eye").find_markers(FRAME, Q).markers == {}


@pytest.mark.parametrize(
    ("pose", "covariance", "why"),
    [
        (2.0 * np.eye(4), COVARIANCE, "homogeneous"),
        (np.full((4, 4), np.nan), COVARIANCE, "finite"),
        (pose_at(0.0, 0.0, 0.5), -COVARIANCE, "positive definite"),
        (pose_at(0.0, 0.0, 0.5), COVARIANCE[:3, :3], "shape"),
        (np.eye(4), COVARIANCE, "FixedHand found the hand at z = 0 m .* is before the camera"),
        (pose_at(0.1, 0.0, -0.5), COVARIANCE, "at z = -0.5 m .* is before the camera"),
    ],
)
def test_a_detector_that_returns_no_pose_is_refused(
    arm: ArmKinematics, pose: np.ndarray, covariance: np.ndarray, why: str
) -> None:
    finder = HandShape(FixedHand(HandDetection(pose, covariance)), None, arm, "eye")
    with pytest.raises(AgentError, match=why):
        finder.find(FRAME, Q)


class FixedHands(FixedHand):
    """Returns the same for all frames as all hands in it."""

    def hands(self, frame_rgb: np.ndarray, expected: np.ndarray | None = None) -> Any:
        return self.outcome


@pytest.mark.parametrize(
    ("kind", "result", "sentence"),
    [
        (FixedHand, None, "FixedHand returned NoneType from detect, but must return a HandDet"),
        (FixedHand, (np.eye(4), COVARIANCE), "returned tuple from detect, but must return a Han"),
        (FixedHands, None, "FixedHands returned NoneType from hands, but must return a tuple of"),
        (FixedHands, (None,), "returned a tuple with NoneType from hands, but must return a tuple"),
        (FixedHands, HandDetection(pose_at(0.0, 0.0, 0.5), COVARIANCE), "HandDetection from hands"),
    ],
)
def test_what_a_detector_returns_is_named_if_it_is_no_detection(
    arm: ArmKinematics, kind: type[FixedHand], result: Any, sentence: str
) -> None:
    with pytest.raises(AgentError, match=sentence):
        HandShape(kind(result), None, arm, "eye").find(FRAME, Q)


def test_a_detector_of_a_frame_that_the_robot_lacks_is_refused(arm: ArmKinematics) -> None:
    hand = FixedHand(HandSkip.NOT_SEEN)
    hand.frame = "foot"
    with pytest.raises(AgentError, match="'foot', which is no frame"):
        HandShape(hand, None, arm, "eye")


def test_a_detector_knows_whether_a_frame_shows_the_hand_from_any_side(arm: ArmKinematics) -> None:
    finder = HandShape(FixedHand(HandSkip.NOT_SEEN), None, arm, "eye")
    assert finder.shows(pose_at(0.0, 0.0, 0.5))
    assert not finder.around(pose_at(0.0, 0.0, -0.5))
