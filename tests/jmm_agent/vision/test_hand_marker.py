"""The hand's marker: predicted by the kinematics, and found among the markers of a frame."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.vision.hand_finder import HandMissed, HandSeen
from jmm_agent.vision.hand_marker import NO_MARKER, HandMarker
from jmm_agent.vision.marker_detector import Detections, MarkerPose, Skip
from tests.jmm_agent.nominal_arm import posture_set

HAND, CAN = 0, 1
Q = posture_set()[0]
FRAME = np.zeros((4, 4, 3), dtype=np.uint8)


class FixedDetector:
    """Returns the same detections for all frames, and records what was expected."""

    def __init__(self, detections: Detections) -> None:
        self.detections = detections
        self.expected: Mapping[int, np.ndarray] | None = None

    def detect(
        self, frame_rgb: np.ndarray, expected: Mapping[int, np.ndarray] | None = None
    ) -> Detections:
        self.expected = expected
        return self.detections


def marker(number: int) -> MarkerPose:
    corners = np.array([[3.0, 1.0], [13.0, 1.0], [13.0, 6.0], [3.0, 6.0]])
    return MarkerPose(number, np.eye(4), corners, 0.1, np.diag([1.0, -1.0, -1.0, 1.0]), 9.0)


def test_the_predicted_pose_is_that_of_the_site_in_the_camera(arm: ArmKinematics) -> None:
    detector = FixedDetector(Detections({HAND: marker(HAND)}, {}, ()))
    hand = HandMarker(detector, arm, HAND, "eye", "marker_hand", 0.003)
    predicted = np.linalg.inv(arm.pose("eye", Q)) @ arm.pose("marker_hand", Q)
    np.testing.assert_allclose(hand.pose(Q), predicted, atol=1e-12)
    hand.find(FRAME, Q)
    assert detector.expected is not None
    assert list(detector.expected) == [HAND]
    np.testing.assert_array_equal(detector.expected[HAND], hand.pose(Q))


def test_the_hands_marker_is_found_beside_another_one(arm: ArmKinematics) -> None:
    detections = Detections({HAND: marker(HAND), CAN: marker(CAN)}, {}, ())
    hand = HandMarker(FixedDetector(detections), arm, HAND, "eye", "marker_hand", 0.003)
    found = hand.find(FRAME, Q)
    assert found.markers is detections.poses
    assert isinstance(found.hand, HandSeen)
    assert found.hand.pose is detections.poses[HAND].pose_marker_in_camera
    assert found.hand.flipped is detections.poses[HAND].flipped_in_camera
    assert found.hand.frames is None
    assert found.hand.covariance is None
    assert found.hand.side_px == 10.0
    assert hand.find(FRAME, Q) is found
    assert hand.find_markers(FRAME, Q) is found


def test_a_hand_without_a_pose_has_a_reason(arm: ArmKinematics) -> None:
    detections = Detections({CAN: marker(CAN)}, {HAND: Skip.TWICE}, ())
    hand = HandMarker(FixedDetector(detections), arm, HAND, "eye", "marker_hand", 0.003)
    assert hand.find(FRAME, Q).hand == HandMissed("doubled", NO_MARKER)
