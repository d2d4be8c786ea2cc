"""Video of a robot's camera, and the distribution of its colours."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
import numpy as np

from jmm_agent.types import Ints
from kengoro.demonstrations.damage import damaged
from kengoro_env.vision.head_camera import PERIOD
from kengoro_env.vision.rendering import Image
from mjcf_sandbox.files import whole_file

RATE = round(1 / PERIOD)
"""Frames per second: those of the camera."""
SAMPLED = 8
"""Every which row and column of a frame is counted in the histograms."""


class FrameWriter:
    """Appends the frames of several episodes to one video; made by `open_frames`.

    Args:
        writer: imageio's writer of the file.

    Attributes:
        count: number of frames until now.
    """

    def __init__(self, writer: Any) -> None:
        self._writer = writer
        self.count = 0
        self._histogram = np.zeros((3, 256), dtype=np.int64)

    def add(self, frame: Image) -> None:
        """Append a frame, shape (480, 640, 3), RGB."""
        self._writer.append_data(frame)
        self.count += 1
        for own, values in zip(self._histogram, np.moveaxis(_thin(frame), -1, 0), strict=True):
            own += np.bincount(values.ravel(), minlength=256)

    def pop_histogram(self) -> Ints:
        """Number of pixels by channel and value since the last call, shape (3, 256)."""
        found, self._histogram = self._histogram, np.zeros_like(self._histogram)
        return found


def count_frames(path: Path) -> int:
    """Number of frames that can be read from a video.

    Raises:
        UsageError: the file is no video, or is damaged.
    """
    try:
        reader: Any = imageio.get_reader(path)
        with closing(reader):
            return sum(1 for _ in reader)
    except Exception as error:  # imageio and its plugins raise errors of many kinds
        raise damaged(path) from error


def _thin(frame: Image) -> Image:
    return frame[::SAMPLED, ::SAMPLED]


@contextmanager
def open_frames(path: Path) -> Iterator[FrameWriter]:
    """Open a video file for writing within this context; it appears at the end, if no error did.

    Every fifth frame is a key frame, so that a reader finds any frame quickly. One thread, so that
    the same frames give the same bits.

    Args:
        path: MP4 file; its folder is made.
    """
    with (
        whole_file(path) as beside,
        closing(
            imageio.get_writer(
                beside, fps=RATE, codec="libx264", quality=None, macro_block_size=16,
                output_params=["-crf", "20", "-g", f"{RATE}", "-threads", "1"],
            )
        ) as writer,
    ):  # fmt: skip
        yield FrameWriter(writer)
