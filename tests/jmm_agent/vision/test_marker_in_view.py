"""Whether a frame would show a marker, for cameras of several sizes and lenses."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.hand_marker import HandMarker
from jmm_agent.vision.marker_detector import Detections, MarkerDetector
from jmm_agent.vision.marker_in_view import PredictingDetector

NARROW = Camera(320, 200, 400.0, 400.0, 159.5, 99.5)
WIDE = Camera(1280, 720, 400.0, 420.0, 600.0, 380.0, (-0.1, 0.02, 0.0, 0.0, 0.0))
SIDE = 0.04


def facing(x: float, y: float, z: float, tilt: float = 0.0) -> Floats:
    """Pose (4, 4) of a marker that faces the camera, tilted about its x axis [rad]."""
    pose = np.eye(4)
    pose[:3, :3] = np.diag([1.0, -1.0, -1.0]) @ cv2.Rodrigues(np.array([tilt, 0.0, 0.0]))[0]
    pose[:3, 3] = x, y, z
    return pose


@pytest.mark.parametrize(
    ("pose", "narrow", "wide"),
    [
        pytest.param(facing(0.0, 0.0, 0.5), True, True, id="in the middle"),
        pytest.param(facing(0.17, 0.0, 0.5), True, True, id="just inside at the right"),
        pytest.param(facing(0.19, 0.0, 0.5), False, True, id="cut off at the right"),
        pytest.param(facing(0.0, -0.12, 0.5), False, True, id="above"),
        pytest.param(facing(0.0, 0.0, 0.04), False, True, id="too near for all corners"),
        pytest.param(facing(0.0, 0.0, -0.5), False, False, id="behind"),
        pytest.param(facing(0.0, 0.0, 0.5, 1.3), True, True, id="tilted"),
        pytest.param(facing(0.0, 0.0, 0.5, 1.6), False, False, id="turned away"),
    ],
)
def test_a_marker_is_shown_if_all_corners_are_in_the_frame(
    pose: Floats, narrow: bool, wide: bool
) -> None:
    for camera, expected in ((NARROW, narrow), (WIDE, wide)):
        detector = MarkerDetector(camera, {7: SIDE})
        assert detector.shows(7, pose) == expected


def test_a_marker_that_is_shown_is_in_the_frame_by_pixels() -> None:
    """Independently of the detector: corners by OpenCV's projection, over random poses."""
    rng, half = np.random.default_rng(0), SIDE / 2
    corners = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
    detector, both = MarkerDetector(NARROW, {7: SIDE}), []
    for _ in range(300):
        pose = facing(*rng.uniform(-0.25, 0.25, 2), rng.uniform(0.2, 0.8), rng.uniform(-1, 1))
        turn, _ = cv2.Rodrigues(pose[:3, :3])
        pixels = cv2.projectPoints(corners, turn, pose[:3, 3], NARROW.matrix, np.zeros(4))[0]
        inside = np.all((pixels >= 0) & (pixels <= [319, 199]))
        assert detector.shows(7, pose) == inside
        both.append(bool(inside))
    assert 30 < sum(both) < 270


def test_a_detector_that_cannot_predict_leaves_it_unknown() -> None:
    class Plain:
        def detect(self, frame_rgb: np.ndarray, expected: object = None) -> Detections:
            return Detections({}, {}, ())

    marker = HandMarker(Plain(), None, 7, "eye", "hand", 0.003)  # type: ignore[arg-type]
    assert marker.shows is None
    assert not isinstance(Plain(), PredictingDetector)
    known = HandMarker(MarkerDetector(NARROW, {7: SIDE}), None, 7, "eye", "hand", 0.003)  # type: ignore[arg-type]
    assert known.shows is not None
    assert known.shows(facing(0.0, 0.0, 0.5))
