"""Marker poses in rendered frames against the exact ones; frames that cannot be used."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.marker_detector import MarkerDetector, Skip
from tests.jmm_agent.vision.marker_scene import (
    CAMERA,
    SIDE,
    MarkerScene,
    noisy,
    pose_error,
    random_pose,
)

UPRIGHT = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0.4], [0, 0, 0, 1]])


@pytest.fixture(scope="module")
def scene():
    scene = MarkerScene()
    yield scene
    scene.close()


@pytest.fixture
def detector():
    return MarkerDetector(CAMERA, {0: SIDE})


@pytest.fixture(scope="module")
def views(scene):
    rng = np.random.default_rng(7)
    return [(pose, scene.render(pose)) for pose in (random_pose(rng) for _ in range(100))]


def turned(pose, axis, angle):
    turn = np.eye(4)
    turn[:3, :3] = cv2.Rodrigues(angle * np.array(axis, dtype=float))[0]
    return pose @ turn


def test_poses_of_rendered_markers_are_exact_and_none_is_missed_or_flipped(detector, views):
    errors = []
    for true, frame in views:
        marker = detector.detect(frame).poses[0]
        errors.append(pose_error(marker.pose_marker_in_camera, true))
        assert errors[-1][1] < np.deg2rad(3)
        assert marker.reprojection_px <= marker.flipped_reprojection_px
    mm, deg = 1e3 * np.array(errors)[:, 0], np.rad2deg(np.array(errors)[:, 1])
    assert np.median(mm) < 0.1
    assert np.median(deg) < 0.1
    assert np.percentile(mm, 95) < 0.5
    assert np.percentile(deg, 95) < 0.5


def test_corners_are_the_printed_ones_clockwise_from_the_upper_left(detector, scene):
    corners = detector.detect(scene.render(UPRIGHT)).poses[0].corners_px
    half = CAMERA.fx * SIDE / 2 / 0.4
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    np.testing.assert_allclose(corners, (319.5, 239.5) + half * signs, atol=0.05)


@pytest.mark.parametrize("quarter_turns", range(4))
def test_markers_that_face_the_camera_squarely_are_found_at_every_quarter_turn(
    detector, scene, quarter_turns
):
    true = turned(UPRIGHT, (0, 0, 1), quarter_turns * np.pi / 2)
    distance, angle = pose_error(
        detector.detect(scene.render(true)).poses[0].pose_marker_in_camera, true
    )
    assert distance < 1e-3
    assert angle < np.deg2rad(0.5)


@pytest.mark.parametrize("depth", [0.10, 0.15, 0.20])
def test_near_markers_are_found(detector, scene, depth):
    true = turned(UPRIGHT, (1, 0, 0), 0.4)
    true[2, 3] = depth
    marker = detector.detect(scene.render(true)).poses[0]
    assert pose_error(marker.pose_marker_in_camera, true)[0] < 1e-4


def test_the_can_marker_has_the_size_that_its_texture_promises():
    true = turned(UPRIGHT, (1, 0, 0), 0.5)
    scene = MarkerScene(texture="marker_can", plate=0.045)
    found = MarkerDetector(CAMERA, {1: 0.036}).detect(scene.render(true))
    scene.close()
    distance, angle = pose_error(found.poses[1].pose_marker_in_camera, true)
    assert distance < 1e-3
    assert angle < np.deg2rad(0.5)


def test_a_prediction_decides_only_between_solutions_that_fit_alike(detector, scene):
    flat, steep = turned(UPRIGHT, (1, 0, 0), 0.004), turned(UPRIGHT, (1, 0, 0), 0.7)
    for true, chosen_by_prediction in ((flat, True), (steep, False)):
        frame = scene.render(true)
        free = detector.detect(frame).poses[0]
        led = detector.detect(frame, {0: free.flipped_in_camera}).poses[0]
        assert free.ambiguous is chosen_by_prediction
        kept = np.allclose(led.flipped_in_camera, free.flipped_in_camera)
        assert kept is not chosen_by_prediction


def test_a_stripe_over_an_edge_and_noise_cost_little(detector, views):
    rng = np.random.default_rng(0)
    found = []
    for true, frame in views:
        corners = detector.detect(frame).poses[0].corners_px
        left, right = corners[0] * 0.7 + corners[1] * 0.3, corners[3] * 0.7 + corners[2] * 0.3
        spoilt = noisy(frame, rng, 3.0)
        tip = left + 0.03 * (right - left)
        start = left - 0.2 * (right - left)
        cv2.line(spoilt, start.astype(int).tolist(), tip.astype(int).tolist(), (200, 150, 90), 2)
        seen = detector.detect(spoilt)
        if seen.poses:
            found.append(pose_error(seen.poses[0].pose_marker_in_camera, true)[0])
    assert len(found) >= 80
    assert np.median(found) < 0.3e-3


def test_half_hidden_markers_are_skipped(detector, scene):
    frame = scene.render(UPRIGHT).copy()
    frame[:, 300:] = 90
    assert detector.detect(frame).skips == {0: Skip.NOT_SEEN}


def test_an_empty_wall_a_black_frame_and_an_unexpected_marker_are_skips_with_a_reason(
    detector, scene
):
    behind = UPRIGHT.copy()
    behind[2, 3] = -0.4
    assert detector.detect(scene.render(behind)).skips == {0: Skip.NOT_SEEN}
    assert detector.detect(np.zeros((480, 640, 3), np.uint8)).skips == {0: Skip.DARK}
    other = MarkerDetector(CAMERA, {1: 0.036}).detect(scene.render(UPRIGHT))
    assert (other.skips, other.unexpected, other.poses) == ({1: Skip.NOT_SEEN}, (0,), {})


def test_a_marker_seen_twice_is_skipped_and_its_neighbour_is_not(scene):
    both = MarkerDetector(CAMERA, {0: SIDE, 1: 0.036})
    frame = scene.render(UPRIGHT).copy()
    plate = frame[190:290, 270:370].copy()
    frame[20:120, 20:120] = plate
    image = cv2.aruco.generateImageMarker(
        cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), 1, 90
    )
    frame[330:450, 450:570] = 255
    frame[345:435, 465:555] = image[..., None]
    seen = both.detect(frame)
    assert seen.skips == {0: Skip.TWICE}
    assert list(seen.poses) == [1]


@pytest.mark.parametrize(
    "frame",
    [
        np.zeros((240, 320, 3), np.uint8),
        np.zeros((480, 640), np.uint8),
        np.zeros((480, 640, 3), np.float32),
        None,
        [[0]],
    ],
)
def test_frames_of_another_shape_or_type_are_refused_in_one_sentence(detector, frame):
    with pytest.raises(AgentError, match=r"^The camera frame is .*must be .* \(480, 640, 3\)\.$"):
        detector.detect(frame)


@pytest.mark.parametrize(
    ("side_by_id", "message"),
    [
        ({}, "at least one marker"),
        ({50: 0.05}, "id 50 .* from 0 to 49"),
        ({0: 0.0}, "side of marker 0"),
        ({0: np.nan}, "side of marker 0"),
        ({0: 50.0}, "50.0; it must be a number of metres above 0 and up to 5"),
        ({0: "5cm"}, "side of marker 0 is '5cm'"),
        ({0: None}, "side of marker 0 is None"),
        ({0: True}, "side of marker 0 is True"),
        ({0: np.complex128(0.05)}, "side of marker 0 is .*0.05.*; it must be a number"),
        ({"0": 0.05}, "id '0' is not in DICT_4X4_50; ids are whole numbers from 0 to 49"),
        ({0.5: 0.05}, "id 0.5 is not in"),
        ({-1: 0.05}, "id -1 is not in"),
        (0.05, r"at least one marker id .* got 0\.05"),
    ],
)
def test_impossible_markers_are_refused(side_by_id, message):
    with pytest.raises(AgentError, match=message):
        MarkerDetector(CAMERA, side_by_id)


@pytest.mark.parametrize(
    "expected",
    [
        {3: np.eye(4)},
        {0: np.eye(3)},
        {0: np.full((4, 4), np.nan)},
        {0: np.full((4, 4), None)},
        {0: [[1], [1, 2]]},
        {0: "pose"},
        {0: np.zeros((4, 4))},
        {0: 1e300 * np.eye(4)},
        [np.eye(4)],
    ],
)
def test_impossible_predictions_are_refused(detector, expected):
    with pytest.raises(AgentError, match=r"[Pp]redicted"):
        detector.detect(np.zeros((480, 640, 3), np.uint8), expected)


def test_a_marker_predicted_in_the_centre_of_the_camera_is_not_searched(detector):
    frame = np.full((480, 640, 3), 90, np.uint8)
    assert detector.detect(frame, {0: np.eye(4)}).skips == {0: Skip.NOT_SEEN}
    assert detector.detect(frame, {0: np.eye(4).tolist()}).skips == {0: Skip.NOT_SEEN}


def test_a_detector_without_a_camera_is_refused():
    with pytest.raises(AgentError, match="needs a Camera, got NoneType"):
        MarkerDetector(None, {0: SIDE})


@pytest.mark.parametrize("arguments", [(0, 480, 500.0), (640, 480, -1.0), (640, 480, np.inf)])
def test_impossible_cameras_are_refused(arguments):
    with pytest.raises(AgentError, match="camera"):
        Camera(*arguments, 500.0, 319.5, 239.5)


def test_a_camera_from_its_field_of_view():
    camera = Camera.from_fovy(640, 480, np.deg2rad(45))
    upper = np.linalg.solve(camera.matrix, [319.5, -0.5, 1.0])  # the border, half a pixel above
    np.testing.assert_allclose(np.arctan(upper[1]), -np.deg2rad(22.5), atol=1e-12)
    np.testing.assert_allclose(camera.fx, 579.41, atol=0.01)
    with pytest.raises(AgentError, match="0 and pi"):
        Camera.from_fovy(640, 480, 4.0)
