"""Tests of crops as a virtual camera sees them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from jmm_agent.vision.camera import Camera
from jmm_agent.vision.crop_view import hand_view, looking_at, roll_of

IDEAL = Camera.from_fovy(640, 480, np.deg2rad(45))
BENT = Camera(640, 480, 579.0, 579.0, 319.5, 239.5, (-0.2, 0.05, 0.001, -0.002))
SMALL = Camera.from_fovy(320, 240, np.deg2rad(60))
FINE = Camera.from_fovy(1920, 1440, np.deg2rad(45))


def dots(camera: Camera, points: np.ndarray) -> np.ndarray:
    """A frame with a white spot at each point."""
    frame = np.zeros((camera.height, camera.width, 3), dtype=np.uint8)
    for x, y in camera.project(points):
        cv2.circle(frame, (round(16 * x), round(16 * y)), 48 * camera.width // 640, (255,) * 3, -1,
                   cv2.LINE_AA, 4)  # fmt: skip
    return frame


@pytest.mark.parametrize(
    "camera", [IDEAL, BENT, SMALL, FINE], ids=["ideal", "bent", "small", "fine"]
)
@pytest.mark.parametrize("roll", [0.0, 1.3])
def test_a_crop_shows_points_at_the_pixels_of_the_view(camera: Camera, roll: float) -> None:
    middle = np.array([0.08, -0.05, 0.5])
    points = middle + np.array([[0.0, 0.0, 0.0], [0.05, 0.02, 0.01], [-0.04, 0.05, -0.02]])
    view = looking_at(middle, 0.25, 128, roll)
    for point, pixel in zip(points, view.project(points), strict=True):
        crop = view.cut(dots(camera, point[None]), camera)[..., 0].astype(float)
        rows, columns = np.indices(crop.shape)
        centre = np.array([(columns * crop).sum(), (rows * crop).sum()]) / crop.sum()
        assert np.linalg.norm(centre - pixel) < 0.3


def test_pixels_and_slopes_of_a_view_are_inverse() -> None:
    view = looking_at(np.array([0.1, 0.2, 1.0]), 0.3, 96, 0.4)
    points = np.array([[0.1, 0.2, 1.0], [0.2, 0.25, 1.1]])
    turned = points @ view.rotation
    assert view.slopes(view.project(points)) == pytest.approx(turned[:, :2] / turned[:, 2:])
    assert view.project(points)[0] == pytest.approx([47.5, 47.5])


def test_a_level_view_of_a_hand_turned_about_the_camera_ray_is_the_same() -> None:
    pose, centre = np.eye(4), np.array([0.0, 0.01, -0.05])
    pose[:3, 3] = 0.1, 0.05, 0.6
    level = hand_view(pose, centre, 0.1, 64, level=True)
    assert roll_of(level.rotation.T @ pose[:3, :3]) == pytest.approx(0.0, abs=1e-9)
    axis = pose[:3, :3] @ centre + pose[:3, 3]
    turn = cv2.Rodrigues(1.1 * axis / np.linalg.norm(axis))[0]
    turned = np.eye(4)
    turned[:3] = turn @ pose[:3]
    other = hand_view(turned, centre, 0.1, 64, level=True)
    points = np.array([[0.03, 0.02, -0.04], [0.0, 0.05, -0.1]])
    first = level.project(points @ pose[:3, :3].T + pose[:3, 3])
    second = other.project(points @ turned[:3, :3].T + turned[:3, 3])
    assert second == pytest.approx(first, abs=1e-6)


def test_what_the_frame_does_not_show_is_black() -> None:
    frame = np.full((480, 640, 3), 200, dtype=np.uint8)
    crop = looking_at(np.array([0.55, 0.0, 1.0]), 0.2, 64).cut(frame, IDEAL)
    assert (crop[:, :20] == 200).all()
    assert (crop[:, -8:] == 0).all()
