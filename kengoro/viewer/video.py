"""Video of a session: the view of the robot's camera beside the view from outside."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import cv2
import imageio.v2 as imageio
import numpy as np

from kengoro_env.vision.rendering import Image
from mjcf_sandbox.files import whole_file

RATE = 25
"""Frames per second of the video."""


class Video:
    """Appends frames to a video file; made by `open_video`.

    Args:
        writer: imageio's writer of the file.
    """

    def __init__(self, writer: Any) -> None:
        self._writer = writer

    def add(self, camera: Image, outside: Image, title: str, clock: str) -> None:
        """Append a frame of two views.

        Args:
            camera: view of the robot's camera, shape (480, 640, 3), RGB.
            outside: view from outside, shape (480, 640, 3), RGB.
            title: text over the outside view.
            clock: text over the camera view.
        """
        picture = np.ascontiguousarray(np.hstack([camera, outside]))
        width = camera.shape[1]
        for text, x in ((f"robot's camera   {clock}", 12), (title, width + 12)):
            cv2.rectangle(picture, (x - 12, 0), (x + 330, 40), (255, 255, 255), cv2.FILLED)
            cv2.putText(picture, text, (x, 27), cv2.FONT_HERSHEY_SIMPLEX, 0.7, (20, 20, 20), 1)
        self._writer.append_data(picture)


@contextmanager
def open_video(path: Path) -> Iterator[Video]:
    """Open a video file for writing within this context.

    The file appears at the end of the context, and not at all if an error is raised within it.

    Args:
        path: MP4 file; its folder is made.
    """
    with (
        whole_file(path) as beside,
        closing(
            imageio.get_writer(beside, fps=RATE, codec="libx264", quality=7, macro_block_size=16)
        ) as writer,
    ):
        yield Video(writer)
