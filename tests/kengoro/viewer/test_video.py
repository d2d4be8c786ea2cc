"""A video is written whole or not at all."""

from __future__ import annotations

from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest

from kengoro.viewer.video import open_video


def test_a_frame_has_the_camera_view_left_of_the_outside_view(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "episode.mp4"
    camera, outside = np.full((480, 640, 3), 60, np.uint8), np.full((480, 640, 3), 200, np.uint8)
    with open_video(path) as video:
        for step in range(3):
            video.add(camera, outside, "approach 1", f"{step:5.1f} s")
        assert not path.exists()
    frames = imageio.imread(path)
    assert frames.shape == (3, 480, 1280, 3)
    assert abs(frames[:, 100:, :600].mean() - 60) < 3
    assert abs(frames[:, 100:, 680:].mean() - 200) < 3
    assert frames[:, :40, :330].mean() > 200  # the texts stand on white
    assert [file.name for file in path.parent.iterdir()] == ["episode.mp4"]


def test_an_error_leaves_no_file(tmp_path: Path) -> None:
    picture = np.zeros((480, 640, 3), np.uint8)

    def fail() -> None:
        with open_video(tmp_path / "episode.mp4") as video:
            video.add(picture, picture, "", "")
            raise RuntimeError("stop")

    with pytest.raises(RuntimeError, match="stop"):
        fail()
    assert list(tmp_path.iterdir()) == []
