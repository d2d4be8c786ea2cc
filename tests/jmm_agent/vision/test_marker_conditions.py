"""Markers in the frames of other cameras, of other dictionaries, and in bad conditions."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.marker_detector import MarkerDetector, Skip
from tests.jmm_agent.vision.marker_scene import pose_error
from tests.jmm_agent.vision.plate_scene import GROUND, SIDE, ground, paint, plate_pose, taken

VGA = Camera(640, 480, 580.0, 580.0, 319.5, 239.5)
OFF_CENTRE = Camera(640, 480, 580.0, 560.0, 344.5, 222.5)
BARREL = replace(VGA, distortion=(-0.3, 0.0, 0.0, 0.0))
FISHEYE = Camera(640, 480, 250.0, 250.0, 320.0, 240.0, (0.05, -0.01, 0.0, 0.0), "fisheye")


def errors(
    camera: Camera,
    size: float = 90.0,
    count: int = 6,
    spoil=lambda frame, pose: frame,
    light: float = 1.0,
    noise: float = 1.0,
    **marker,
) -> np.ndarray:
    """Errors [mm, deg] of a marker in frames of a camera; NaN where it is not found."""
    rng, found = np.random.default_rng(5), []
    detector = MarkerDetector(camera, {0: SIDE}, **marker)
    for _ in range(count):
        pose, frame = plate_pose(camera, rng, size), ground(camera)
        paint(frame, camera, pose, **marker)
        seen = detector.detect(taken(spoil(frame, pose), rng, noise, light)).poses
        error = pose_error(seen[0].pose_marker_in_camera, pose) if seen else (np.nan, np.nan)
        found.append((1e3 * error[0], np.rad2deg(error[1])))
    return np.array(found)


@pytest.mark.parametrize("camera", [OFF_CENTRE, BARREL, FISHEYE], ids=["off", "barrel", "fisheye"])
def test_intrinsics_and_distortion_go_through_all_steps(camera: Camera) -> None:
    # As an ideal, centred camera with fx = fy the first of these misses a third of the markers, by
    # 18 mm and 3.5 deg; the second is 2.2 mm off.
    found = errors(camera)
    assert np.isfinite(found).all()
    assert (np.median(found, axis=0) < [0.1, 0.15]).all()
    assert (found.max(axis=0) < [0.6, 1.0]).all()


@pytest.mark.parametrize(
    "dictionary", ["DICT_5X5_100", "DICT_6X6_250", "DICT_APRILTAG_36h11", "DICT_ARUCO_ORIGINAL"]
)
def test_markers_of_any_dictionary_are_found(dictionary: str) -> None:
    found = errors(VGA, count=4, dictionary=dictionary)
    assert (found.max(axis=0) < [0.5, 1.0]).all()


def test_a_border_of_two_cells_is_found() -> None:
    assert (errors(VGA, count=4, border=2).max(axis=0) < [0.5, 1.0]).all()


def test_dictionaries_ids_and_borders_that_do_not_exist_are_refused() -> None:
    with pytest.raises(AgentError, match=r"'DICT_5x5_100'; there are: DICT_5X5_100"):
        MarkerDetector(VGA, {0: SIDE}, dictionary="DICT_5x5_100")
    with pytest.raises(AgentError, match=r"id 100 is not in DICT_5X5_100; .* from 0 to 99"):
        MarkerDetector(VGA, {100: SIDE}, dictionary="DICT_5X5_100")
    for border in (0, 1.5, None, 10**6):
        with pytest.raises(AgentError, match=f"border of a marker is {border} cells"):
            MarkerDetector(VGA, {0: SIDE}, border=border)


def test_markers_are_found_at_6_percent_of_the_light() -> None:
    found = errors(VGA, light=0.06, noise=0.5)
    assert np.isfinite(found).all()
    assert (np.median(found, axis=0) < [0.3, 0.5]).all()


def test_markers_of_20_pixels_are_measured() -> None:
    found = errors(VGA, size=20.0)
    assert np.isfinite(found).all()
    assert np.median(found[:, 0]) < 2.5  # at 1.45 m
    assert np.median(found[:, 1]) < 0.5


@pytest.mark.parametrize("blur", ["motion", "defocus"])
def test_blurred_markers_are_measured(blur: str) -> None:
    kernel = np.zeros((9, 9))
    if blur == "motion":
        kernel[4] = 1 / 9
    else:
        kernel = cv2.circle(kernel, (4, 4), 4, 1.0, -1)
        kernel /= kernel.sum()
    found = errors(VGA, spoil=lambda frame, pose: cv2.filter2D(frame, -1, kernel))
    assert np.isfinite(found).all()
    assert (np.median(found, axis=0) < [0.4, 0.5]).all()


def test_a_finger_over_a_corner_does_not_move_the_pose() -> None:
    def finger(frame: np.ndarray, pose: np.ndarray) -> np.ndarray:
        tip = VGA.project(pose[:3, 3] + pose[:3, :2] @ [0.55 * SIDE, 0.55 * SIDE])
        size = VGA.fx * SIDE / pose[2, 3]
        return cv2.circle(frame, np.rint(tip).astype(int).tolist(), int(0.13 * size), 60.0, -1)

    found = errors(VGA, spoil=finger)
    assert np.isfinite(found).all()
    assert (np.median(found, axis=0) < [0.2, 0.2]).all()
    assert (found.max(axis=0) < [1.0, 1.0]).all()


def test_all_five_markers_of_a_12_megapixel_photograph_are_found() -> None:
    camera = Camera(4000, 3000, 3000.0, 3000.0, 1999.5, 1499.5)
    frame, rng, poses = ground(camera), np.random.default_rng(0), {}
    for marker in range(5):
        pose = np.diag([1.0, -1.0, -1.0, 1.0])
        pose[:3, :3] = cv2.Rodrigues(rng.normal(0, 0.3, 3))[0] @ pose[:3, :3]
        pose[:3, 3] = [-0.25 + 0.12 * marker, 0.1 * (-1) ** marker, 0.6 + 0.4 * marker]
        paint(frame, camera, pose, marker)
        poses[marker] = pose
    # The texture of a photograph, seen at all scales.
    frame += np.repeat(np.repeat(rng.normal(0, 3, (750, 1000)), 4, axis=0), 4, axis=1)
    found = MarkerDetector(camera, dict.fromkeys(range(5), SIDE)).detect(taken(frame, rng)).poses
    assert sorted(found) == [0, 1, 2, 3, 4]
    for marker, pose in poses.items():
        distance, angle = pose_error(found[marker].pose_marker_in_camera, pose)
        assert distance < 1e-3 * pose[2, 3]
        assert angle < np.deg2rad(1.0)


@pytest.mark.parametrize("camera", [VGA, FISHEYE], ids=["ideal", "fisheye"])
def test_the_covariance_of_a_pose_is_that_of_its_errors(camera: Camera) -> None:
    rng, scores = np.random.default_rng(3), []
    detector = MarkerDetector(camera, {0: SIDE})
    for noise in (1.0, 12.0):
        for _ in range(6):
            pose, frame = plate_pose(camera, rng, 70.0), ground(camera)
            paint(frame, camera, pose)
            marker = detector.detect(taken(frame, rng, noise)).poses[0]
            offset = marker.pose_marker_in_camera[:3, 3] - pose[:3, 3]
            turn = cv2.Rodrigues(marker.pose_marker_in_camera[:3, :3] @ pose[:3, :3].T)[0].ravel()
            error = np.concatenate([offset, turn])
            scores.append(error @ np.linalg.solve(marker.covariance, error) / 6)
    assert 0.1 < np.median(scores) < 3.0


def test_a_marker_that_is_not_found_at_once_is_searched_near_its_predicted_pose() -> None:
    rng = np.random.default_rng(0)
    pose, frame = plate_pose(VGA, rng, 90.0), ground(VGA)
    paint(frame, VGA, pose)
    tip = VGA.project(pose[:3, 3] + pose[:3, :2] @ [0.55 * SIDE, 0.55 * SIDE])
    cv2.circle(frame, np.rint(tip).astype(int).tolist(), 12, 60.0, -1)
    image, detector = taken(frame, rng), MarkerDetector(VGA, {0: SIDE})
    assert list(detector.detect(image, {0: pose}).poses) == [0]
    away = pose @ np.diag([1.0, -1.0, -1.0, 1.0])  # the hand's back
    assert detector.detect(image, {0: away}).skips.keys() <= {0}


def test_a_ground_without_a_marker_is_none() -> None:
    rng = np.random.default_rng(1)
    frame = taken(np.full((480, 640), GROUND), rng, noise=12.0)
    assert MarkerDetector(VGA, {0: SIDE}).detect(frame).skips == {0: Skip.NOT_SEEN}
