"""Camera and marker on simulated frames: each fault is found, and its end, too."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jmm_agent.guard import faults
from jmm_agent.guard.camera_monitor import CameraMonitorOptions, FrozenCameraMonitor, HandMonitor
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.hand_finder import HandMissed, HandSeen
from jmm_agent.vision.hand_marker import NO_MARKER, hand_of
from jmm_agent.vision.marker_detector import MarkerPose

ABSENT, DOUBLED = HandMissed("absent", NO_MARKER), HandMissed("doubled", NO_MARKER)


def test_a_camera_freezes_when_no_frame_comes_or_the_hand_moves_in_the_same_picture() -> None:
    monitor = FrozenCameraMonitor(CameraMonitorOptions())
    frame, lengths = np.zeros((4, 4, 3), dtype=np.uint8), np.zeros(3)
    assert not monitor.is_new(0.0, -np.inf)
    assert not monitor.frozen  # without a camera no frame is missed
    assert monitor.is_new(0.1, 0.0)
    assert monitor.is_another(frame, lengths, True)
    assert not monitor.is_new(1.0, 0.0)
    assert not monitor.frozen
    monitor.is_new(1.2, 0.0)
    assert monitor.frozen
    assert monitor.is_new(1.3, 1.2)
    assert not monitor.frozen
    assert not monitor.is_another(frame, lengths + 0.001, True)
    assert not monitor.frozen
    monitor.is_another(frame, lengths + 0.01, False)
    assert not monitor.frozen
    monitor.is_another(frame, lengths + 0.01, True)
    assert monitor.frozen
    assert monitor.is_another(frame + 1, lengths + 0.01, True)
    assert not monitor.frozen


def test_one_pixel_of_the_last_row_makes_another_frame() -> None:
    monitor, lengths = FrozenCameraMonitor(CameraMonitorOptions()), np.zeros(2)
    frame = np.zeros((50, 40, 3), dtype=np.uint8)
    monitor.is_another(frame, lengths, True)
    frame[-1, -1, -1] = 1  # the driver writes into the same memory
    assert monitor.is_another(frame, lengths, True)
    assert not monitor.is_another(frame, lengths, True)
    assert monitor.is_another(frame[:48], lengths, True)


def test_a_camera_that_turns_without_another_picture_is_frozen() -> None:
    monitor = FrozenCameraMonitor(CameraMonitorOptions())
    frame, lengths = np.zeros((4, 4, 3), dtype=np.uint8), np.zeros(3)

    def frozen_at(degrees: float) -> bool:
        turned = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
        monitor.is_another(frame, lengths, False, turned)
        return monitor.frozen

    assert [frozen_at(angle) for angle in (0.0, 5.0, 7.0)] == [False, False, True]
    frame = frame + np.uint8(1)
    assert not frozen_at(7.0)
    monitor.forget_estimate()
    assert [frozen_at(angle) for angle in (20.0, 25.0, 27.0)] == [False, False, True]


def facing(angle: float, x: float = 0.0) -> np.ndarray:
    """A marker's pose in the camera, half a metre away, turned from the line of sight [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ np.diag([1.0, -1.0, -1.0])
    pose[:3, 3] = [x, 0.0, 0.5]
    return pose


def seen(angle: float, x: float = 0.0) -> HandSeen:
    pose, flipped = facing(angle, x), facing(-angle, x)
    return hand_of(MarkerPose(0, pose, np.zeros((4, 2)), 0.01, flipped, 1.0))


@pytest.fixture
def marker() -> HandMonitor:
    monitor = HandMonitor(Camera(640, 480, 580.0, 580.0, 319.5, 239.5), CameraMonitorOptions())
    monitor.update(0.0, seen(0.4), facing(1.0))  # the estimate is wrong by 0.6 rad
    assert list(monitor.found()) == []
    return monitor


def test_a_marker_that_must_be_in_view_is_missed(marker: HandMonitor) -> None:
    marker.update(0.2, ABSENT, facing(1.0))
    assert list(marker.found()) == []
    marker.update(0.4, ABSENT, facing(1.0))
    assert list(marker.found()) == [faults.MARKER_HIDDEN]
    for k in range(3, 14):
        marker.update(0.2 * k, seen(0.4), facing(1.0))
    assert list(marker.found()) == []


@pytest.mark.parametrize(
    ("predicted", "named"),
    [
        (facing(1.0), [faults.MARKER_HIDDEN]),
        (facing(1.1, x=0.04), [faults.MARKER_HIDDEN]),
        (facing(1.2), []),
        (facing(1.0, x=0.06), []),
    ],
)
def test_a_map_that_is_not_trusted_only_misses_a_marker_that_did_not_move(
    marker: HandMonitor, predicted: np.ndarray, named: list[str]
) -> None:
    for k in (1, 2):
        marker.update(0.2 * k, ABSENT, predicted, trusted=False)
    assert list(marker.found()) == named
    for k in (3, 4):
        marker.update(0.2 * k, ABSENT, predicted)
    assert list(marker.found()) == [faults.MARKER_HIDDEN]


def test_a_marker_that_is_hidden_right_after_the_map_changed_is_missed(
    marker: HandMonitor,
) -> None:
    marker.forget_estimate()
    for k in (1, 2):
        marker.update(0.2 * k, ABSENT, facing(1.7))  # where the new map predicts it
    assert list(marker.found()) == [faults.MARKER_HIDDEN]


def test_a_marker_that_left_the_view_before_the_map_changed_is_not_missed(
    marker: HandMonitor,
) -> None:
    marker.update(0.2, ABSENT, facing(1.0, x=0.45))
    marker.forget_estimate()
    for k in range(2, 6):
        marker.update(0.2 * k, ABSENT, facing(1.2, x=0.45))
    assert list(marker.found()) == []


@pytest.mark.parametrize("predicted", [facing(1.0, x=0.45), facing(1.7)])
def test_a_marker_that_leaves_the_view_is_not_missed(
    marker: HandMonitor, predicted: np.ndarray
) -> None:
    for k in range(1, 5):
        marker.update(0.2 * k, ABSENT, predicted)
    assert list(marker.found()) == []


def test_a_second_marker_is_named_even_before_the_first_estimate() -> None:
    monitor = HandMonitor(Camera(640, 480, 580.0, 580.0, 319.5, 239.5), CameraMonitorOptions())
    monitor.update(0.0, DOUBLED, None)
    assert list(monitor.found()) == [faults.SECOND_MARKER]
    monitor.update(0.2, seen(0.4), None)
    assert list(monitor.found()) == []


def test_a_mirrored_marker_is_named_for_as_long_as_it_is(marker: HandMonitor) -> None:
    for k in range(1, 10):
        marker.update(0.2 * k, seen(-0.4), facing(1.0))
        assert list(marker.found()) == [faults.MIRRORED_MARKER]
    marker.update(2.0, seen(-0.05), facing(0.62))  # almost head-on: not decided
    assert list(marker.found()) == [faults.MIRRORED_MARKER]
    marker.update(2.2, seen(0.4), facing(1.0))
    assert list(marker.found()) == []


def test_a_marker_that_stays_mirrored_is_right_after_all(marker: HandMonitor) -> None:
    found = []
    for k in range(1, 100):
        marker.update(0.2 * k, seen(-0.4), facing(1.0))
        found.append(list(marker.found()))
    frames = CameraMonitorOptions().longest / 0.2
    assert found.count([faults.MIRRORED_MARKER]) == pytest.approx(frames, abs=1)
    assert found[-1] == []


def test_a_marker_that_turns_with_the_estimate_is_not_mirrored(marker: HandMonitor) -> None:
    marker.update(0.2, seen(-0.4), facing(0.2))
    assert list(marker.found()) == []


def hidden_at(camera: Camera, x: float, side_px: float) -> bool:
    """Whether a marker that is expected at x [m], and is not seen, is missed."""
    monitor = HandMonitor(camera, CameraMonitorOptions())
    monitor.update(0.0, seen(0.4, x)._replace(side_px=side_px), facing(0.4, x))
    for k in (1, 2):
        monitor.update(0.2 * k, ABSENT, facing(0.4, x))
    return list(monitor.found()) == [faults.MARKER_HIDDEN]


@pytest.mark.parametrize("scale", [0.25, 1.0, 6.0])
def test_the_margin_of_the_frame_is_a_share_of_its_size(scale: float) -> None:
    width, height, focal = round(640 * scale), round(480 * scale), 580.0 * scale
    camera = Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)
    # The right border is at 0.276 m; 70 of 640 px less is 0.2155 m.
    assert hidden_at(camera, 0.21, 50.0 * scale)
    assert not hidden_at(camera, 0.22, 50.0 * scale)


def test_a_near_marker_that_the_border_may_cut_is_not_missed() -> None:
    camera = Camera(640, 480, 580.0, 580.0, 319.5, 239.5)
    assert hidden_at(camera, 0.15, 150.0)
    assert not hidden_at(camera, 0.15, 200.0)  # half its plate may lie outside


def test_the_frame_is_that_of_the_lens_and_not_of_a_centred_ideal_camera() -> None:
    off_centre = Camera(640, 480, 580.0, 580.0, 419.5, 239.5)
    assert not hidden_at(off_centre, 0.2, 50.0)
    assert hidden_at(off_centre, -0.28, 50.0)
    fisheye = Camera(640, 480, 200.0, 200.0, 319.5, 239.5, (), "fisheye")
    assert hidden_at(fisheye, 0.8, 20.0)  # 1.01 rad from the axis; by its slope at x = 640 px
