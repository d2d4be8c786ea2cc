"""Intrinsics and distortion against OpenCV's own projection; binning and regions of interest."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.vision.camera import Camera

PLAIN = Camera(640, 480, 580.0, 560.0, 344.5, 222.5)
BARREL = Camera(640, 480, 580.0, 560.0, 344.5, 222.5, (-0.3, 0.08, 0.001, -0.002, 0.01))
RATIONAL = replace(
    BARREL, distortion=(0.1, -0.2, 0.001, 0.0, 0.02, 0.2, -0.1, 0.01), model="rational_polynomial"
)
FISHEYE = Camera(640, 480, 250.0, 250.0, 320.0, 240.0, (0.05, -0.01, 0.002, 0.0), "fisheye")


@pytest.mark.parametrize("camera", [PLAIN, BARREL, RATIONAL])
def test_points_are_projected_as_by_opencv(camera: Camera) -> None:
    points = np.random.default_rng(0).uniform([-0.4, -0.3, 0.9], [0.4, 0.3, 1.2], (50, 3))
    coefficients = np.array(camera.distortion or (0.0,) * 4)
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.matrix, coefficients)[0]
    np.testing.assert_allclose(camera.project(points), expected[:, 0], atol=1e-9)


@pytest.mark.parametrize("camera", [PLAIN, BARREL, RATIONAL, FISHEYE])
def test_the_ray_of_a_pixel_is_projected_into_it(camera: Camera) -> None:
    pixels = np.random.default_rng(1).uniform([60, 20], [580, 460], (4, 25, 2))
    np.testing.assert_allclose(camera.project(0.7 * camera.rays(pixels)), pixels, atol=1e-6)


def test_a_fisheye_images_angles_and_not_slopes() -> None:
    camera = Camera(640, 480, 200.0, 200.0, 320.0, 240.0, (), "fisheye")
    steep = camera.project(np.array([np.tan(1.3), 0.0, 1.0]))
    np.testing.assert_allclose(steep, [320.0 + 200.0 * 1.3, 240.0], atol=1e-6)


def test_points_behind_the_camera_or_beyond_its_lens_have_no_pixel() -> None:
    # r (1 - 0.3 r^2) has its maximum at r = 1.054; steeper rays would come back into the frame.
    lens = replace(BARREL, distortion=(-0.3, 0.0, 0.0, 0.0))
    slopes = np.array([0.0, 1.0, 1.1, 1.8])
    points = np.column_stack([slopes, np.zeros(4), np.ones(4)])
    assert np.isfinite(lens.project(points)).all(axis=1).tolist() == [True, True, False, False]
    assert np.isnan(PLAIN.project(-points)).all()
    assert np.isnan(lens.rays(np.array([2000.0, 222.5]))).all()


def test_binning_and_regions_move_pixels_as_the_driver_does() -> None:
    points = np.random.default_rng(2).uniform([-0.3, -0.2, 0.9], [0.3, 0.2, 1.2], (20, 3))
    full = BARREL.project(points)
    np.testing.assert_allclose(BARREL.binned(2, 4).project(points), (full + 0.5) / [2, 4] - 0.5)
    part = BARREL.cropped(100, 50, 320, 240)
    np.testing.assert_allclose(part.project(points), full - [100, 50])
    assert (part.width, part.height) == (320, 240)
    assert (BARREL.binned(3, 1).width, BARREL.binned(3, 1).height) == (213, 480)
    with pytest.raises(AgentError, match=r"Binning by 0 x 2 .* 640 x 480"):
        BARREL.binned(0, 2)
    with pytest.raises(AgentError, match=r"columns is 1.5; it must be a whole number"):
        BARREL.binned(1.5, 2)
    with pytest.raises(AgentError, match=r"left column is 1.5; it must be a whole number"):
        BARREL.cropped(1.5, 0, 10, 10)
    with pytest.raises(AgentError, match=r"320 x 240 px at \(400, 0\) is not inside"):
        BARREL.cropped(400, 0, 320, 240)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 0}, "has no pixels"),
        ({"width": 640.5}, "width is 640.5; it must be a whole number"),
        ({"width": "640"}, "width is '640'; it must be a whole number"),
        ({"height": True}, "height is True; it must be a whole number"),
        ({"width": 10**400}, "it must be a whole number"),
        ({"fx": "580"}, "fx is '580'; it must be a number"),
        ({"cy": None}, "cy is None; it must be a number"),
        ({"distortion": None}, "distortion is None; it must be a flat list"),
        ({"distortion": [[0.1, 0.0, 0.0, 0.0]]}, "it must be a flat list of numbers"),
        ({"fx": 0.0}, "fx is 0"),
        ({"fy": float("nan")}, "fy is nan"),
        ({"cx": float("inf")}, "principal point"),
        ({"cx": 32000.0}, "55.2 focal lengths from its principal point"),
        ({"cy": -32000.0}, "58 focal lengths from its principal point"),
        ({"fx": 0.9, "fy": 1.2, "cx": 0.5, "cy": 0.5}, "must be in pixels of a frame of 640 x 480"),
        ({"fx": 8.0, "fy": 8.0, "model": "fisheye"}, "focal lengths from its principal point"),
        ({"distortion": (-3.0, 0.0, 0.0, 0.0)}, "folds the image: only 1.% of the frame"),
        ({"model": "pinhole"}, "plumb_bob, rational_polynomial, fisheye"),
        ({"distortion": (0.1,)}, "0 or 4 or 5"),
        ({"distortion": (0.1, 0.0, 0.0, float("nan"))}, "finite"),
        ({"distortion": (0.1,) * 5, "model": "fisheye"}, "0 or 4"),
    ],
)
def test_impossible_cameras_are_refused_in_a_sentence(change: dict, message: str) -> None:
    with pytest.raises(AgentError, match=message):
        replace(PLAIN, **change)


def test_a_field_of_view_or_a_path_of_another_type_is_refused_in_a_sentence() -> None:
    with pytest.raises(AgentError, match="vertical view is '45'; it must be a number"):
        Camera.from_fovy(640, 480, "45")
    with pytest.raises(AgentError, match="path of a camera file is None"):
        Camera.from_file(None)


def test_extreme_but_possible_cameras_are_accepted() -> None:
    Camera(640, 480, 120.0, 120.0, 319.5, 239.5)  # 139 deg wide
    Camera(4000, 3000, 3000.0, 3000.0, 1999.5, 1499.5).cropped(3900, 2900, 64, 64)
    Camera(640, 480, 400.0, 400.0, 319.5, 239.5, (-0.4, 0.0, 0.0, 0.0))  # rays but in the corners
    Camera(1280, 960, 200.0, 200.0, 639.5, 479.5, (), "fisheye")  # a circle in the frame


def test_a_camera_from_its_field_of_view_has_square_pixels_and_a_centred_principal_point() -> None:
    camera = Camera.from_fovy(640, 480, np.deg2rad(45))
    assert camera.fx == camera.fy == 240 / np.tan(np.deg2rad(45) / 2)
    assert (camera.cx, camera.cy, camera.distorts) == (319.5, 239.5, False)
