"""Markers as photographs show them: worn, too small to tell their tilt, or of another lens."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from jmm_agent.vision import marker_corners, marker_detector
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.marker_detector import MarkerDetector, Skip
from jmm_agent.vision.marker_search import MarkerSearch
from jmm_agent.vision.square_pose import angle_between, either_covariance
from tests.jmm_agent.vision.marker_scene import pose_error
from tests.jmm_agent.vision.plate_scene import SIDE, ground, paint, plate_pose, taken

VGA = Camera(640, 480, 580.0, 580.0, 319.5, 239.5)


def photograph(size_px: float, seed: int, noise: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Frame of a marker, and its pose (4, 4)."""
    rng = np.random.default_rng(seed)
    pose, frame = plate_pose(VGA, rng, size_px), ground(VGA)
    paint(frame, VGA, pose)
    return taken(frame, rng, noise), pose


def worn(frame: np.ndarray, seed: int) -> np.ndarray:
    """The frame with faded spots of ink, and the blur of a lens."""
    speckles = np.random.default_rng(seed).normal(size=frame.shape[:2])
    speckles = cv2.GaussianBlur(speckles, (0, 0), 3.0)
    spoilt = frame + 60.0 * (speckles > speckles.std())[..., None]
    blurred = cv2.GaussianBlur(np.clip(spoilt, 0, 255).astype(np.float32), (0, 0), 1.5)
    return np.asarray(blurred, np.uint8)


class Counted:
    """A function that counts its calls."""

    def __init__(self, function: Any) -> None:
        self.function, self.calls = function, 0

    def __call__(self, *arguments: Any) -> Any:
        self.calls += 1
        return self.function(*arguments)


def test_a_worn_print_is_fitted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    # A fit takes as long as a whole first pass; five more of each marker took seconds a photograph.
    counted = Counted(marker_corners.fit_pattern)
    monkeypatch.setattr(marker_corners, "fit_pattern", counted)
    detector = MarkerDetector(VGA, {0: SIDE})
    for seed in range(2):
        frame, pose = photograph(110.0, seed)
        found = detector.detect(worn(frame, seed)).poses[0]
        distance, angle = pose_error(found.pose_marker_in_camera, pose)
        assert distance < 1e-3
        assert angle < np.deg2rad(1.0)
    assert counted.calls <= 2


def test_a_marker_that_fits_no_square_is_not_measured_again_in_each_pass(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    counted = Counted(marker_detector.locate_corners)
    monkeypatch.setattr(marker_detector, "locate_corners", counted)
    frame, _ = photograph(120.0, 3)
    seen = MarkerDetector(replace(VGA, fx=400.0), {0: SIDE}).detect(frame)
    assert seen.skips == {0: Skip.NO_POSE}
    assert "the distortion are not those of the camera" in Skip.NO_POSE.value
    assert counted.calls <= 2


def test_two_outlines_of_one_marker_are_one_marker(monkeypatch: pytest.MonkeyPatch) -> None:
    frame, pose = photograph(90.0, 1)
    first = MarkerSearch.first

    def doubled(search: MarkerSearch, gray: np.ndarray) -> list[Any]:
        found = first(search, gray)
        return [(i, q + 0.05 * (q - q.mean(axis=0))) for i, q in found] + found

    monkeypatch.setattr(MarkerSearch, "first", doubled)
    found = MarkerDetector(VGA, {0: SIDE}).detect(frame).poses[0]
    assert pose_error(found.pose_marker_in_camera, pose)[0] < 1e-3


def test_the_covariance_of_an_ambiguous_pose_reaches_to_the_other_solution() -> None:
    ambiguous, detector = 0, MarkerDetector(VGA, {0: SIDE})
    for seed in range(3):
        frame, pose = photograph(18.0, seed, noise=8.0)
        found = detector.detect(frame).poses.get(0)
        assert found is not None
        ambiguous += found.ambiguous
        gap = angle_between(found.pose_marker_in_camera, found.flipped_in_camera)
        assert found.covariance is not None
        deviation = np.sqrt(np.trace(found.covariance[3:, 3:]))
        assert deviation > 0.7 * gap
        led = detector.detect(frame, {0: pose}).poses[0]  # a predicted pose decides
        assert led.covariance is not None
        assert np.trace(led.covariance[3:, 3:]) < 0.5 * np.trace(found.covariance[3:, 3:])
        right = angle_between(led.pose_marker_in_camera, pose)
        assert right <= angle_between(led.flipped_in_camera, pose) + np.deg2rad(1.0)
    assert ambiguous == 3


def test_the_covariance_about_one_of_two_poses_is_the_second_moment_of_both() -> None:
    other = np.eye(4)
    other[:3, :3], other[:3, 3] = cv2.Rodrigues(np.array([0.0, 0.3, 0.0]))[0], [0.0, 0.0, 0.02]
    covariance = either_covariance(1e-6 * np.eye(6), np.eye(4), other)
    np.testing.assert_allclose(covariance[4, 4], 1e-6 + 0.3**2 / 2)
    np.testing.assert_allclose(covariance[2, 4], 0.3 * 0.02 / 2)
    np.testing.assert_allclose(covariance[0, 0], 1e-6)
