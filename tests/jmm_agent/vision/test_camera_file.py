"""Calibration files of OpenCV and ROS, CameraInfo messages, and files that cannot be used."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.vision.camera import Camera

MATRIX = np.array([[580.25, 0, 344.5], [0, 560.5, 222.5], [0, 0, 1]])
LENS = (-0.3, 0.08, 1e-5, -0.002, 0.0)
CAMERA = Camera(640, 480, 580.25, 560.5, 344.5, 222.5, LENS)

ROS = """\
image_width: 640
image_height: 480
camera_name: head
camera_matrix:
  rows: 3
  cols: 3
  data: [580.25, 0, 344.5, 0, 560.5, 222.5, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.3, 0.08, 1e-05, -0.002, 0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [570, 0, 340, 0, 0, 550, 222, 0, 0, 0, 1, 0]
"""


@pytest.mark.parametrize("suffix", ["yml", "xml"])
def test_a_file_of_opencv_is_read(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"camera.{suffix}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("calibration_time", "Thu 01 Jan 1970")
    storage.writeComment("flags: +fix_k3")
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("camera_matrix", MATRIX)
    storage.write("distortion_coefficients", np.array([LENS]).T)
    storage.release()
    assert Camera.from_file(path) == CAMERA
    if suffix == "yml":  # the first line of OpenCV 2 to 4, which is no valid YAML
        text = path.read_text().replace("%YAML 1.2\n", "%YAML:1.0\n")
        path.write_text(text)
        assert Camera.from_file(path) == CAMERA


def test_a_file_of_ros_is_read(tmp_path: Path) -> None:
    path = tmp_path / "head.yaml"
    path.write_text(ROS)
    assert Camera.from_file(path) == CAMERA
    path.write_text(ROS.replace("plumb_bob", "equidistant").replace(", 0]", "]", 1))
    assert Camera.from_file(str(path)).model == "fisheye"


def test_any_path_of_a_file_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "head.yaml"
    path.write_text(ROS)
    [entry] = os.scandir(tmp_path)
    assert Camera.from_file(entry) == CAMERA


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("image_width: 640\n", "", "image_width is missing"),
        ("image_width: 640", "image_width: 6.5", "image_width is 6.5"),
        ("image_width: 640", "image_width: 0", "0 x 480"),
        ("camera_matrix:", "camera_matrices:", "camera_matrix is missing"),
        ("580.25, 0, 344.5", "0, 0, 344.5", "must be positive"),
        ("580.25, 0, 344.5", ".nan, 0, 344.5", "finite numbers"),
        ("580.25, 0, 344.5", "580.25, 0.5, 344.5", r"\[fx, 0, cx, 0, fy, cy, 0, 0, 1\]"),
        ("580.25, 0, 344.5", "580.25, 344.5", "has 8 numbers"),
        ("distortion_coefficients:", "lens:", "distortion_coefficients is missing"),
        ("[-0.3, 0.08,", "[-0.3, 0.08, 0,", "has 6 numbers"),
        ("plumb_bob", "omnidirectional", "valid are: plumb_bob"),
        ("580.25", "[" * 500 + "1" + "]" * 500, "camera"),
        ("camera_name: head", "image_width: 1280", "key 'image_width' occurs twice"),
        ("  rows: 3\n  cols: 3\n  data: [580.25", "  data: [1]\n  data: [580.25", "'data' occurs"),
        (ROS, "<a><camera_matrix/><camera_matrix/></a>", "'camera_matrix' occurs twice"),
        ("camera_name: head", "camera_name: &a [1]\nb: *a", "aliases"),
        ("camera_name: head", "camera_name: !!python/object:os.system x", "not valid YAML"),
        (ROS, "[1, 2]", "keys such as camera_matrix"),
        (ROS, "", "keys such as camera_matrix"),
        (ROS, "a: [", "not valid YAML"),
        (ROS, "<a><b></a>", "not valid YAML or XML"),
        (ROS, '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "entities"),
        (ROS, "x" * (1 << 20) + "xx", "1 MiB"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_in_a_sentence(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    path = tmp_path / "camera.yaml"
    path.write_text(ROS.replace(old, new))
    with pytest.raises(AgentError, match=message) as caught:
        Camera.from_file(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_bytes_that_are_no_text_and_a_missing_file_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    path.write_bytes(b"\x80\x04\x95pickle")
    with pytest.raises(AgentError, match="not valid YAML"):
        Camera.from_file(path)
    with pytest.raises(AgentError, match="no camera file"):
        Camera.from_file(tmp_path / "none.yaml")


def message(**changes: Any) -> dict[str, Any]:
    fields = {
        "width": 640,
        "height": 480,
        "distortion_model": "plumb_bob",
        "K": MATRIX.ravel().tolist(),
        "D": list(LENS),
        "binning_x": 0,
        "binning_y": 0,
        "roi": {"x_offset": 0, "y_offset": 0, "width": 0, "height": 0},
    }
    return fields | changes


def test_a_camera_info_of_ros_is_read_with_binning_and_region() -> None:
    assert Camera.from_camera_info(message()) == CAMERA
    roi = {"x_offset": 100, "y_offset": 50, "width": 320, "height": 240, "do_rectify": False}
    part = Camera.from_camera_info(message(roi=roi, binning_x=2, binning_y=2))
    assert part == CAMERA.cropped(100, 50, 320, 240).binned(2, 2)
    fields = message(roi=SimpleNamespace(**roi), binning_x=2, binning_y=2)
    fields = {("k" if n == "K" else "d" if n == "D" else n): v for n, v in fields.items()}
    assert Camera.from_camera_info(SimpleNamespace(**fields)) == part


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"K": [0.0] * 9}, "without calibration"),
        ({"K": None}, "camera_matrix is missing"),
        ({"binning_x": -2}, "binning_x is -2"),
        ({"roi": {"x_offset": 600, "width": 320, "height": 240}}, "not inside the frame"),
    ],
)
def test_a_camera_info_that_cannot_be_used_is_refused(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(AgentError, match=text):
        Camera.from_camera_info(message(**changes))
