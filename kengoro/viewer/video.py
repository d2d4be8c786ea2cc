"""episode.mp4: what the robot sees beside what a bystander sees."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

import cv2
import imageio.v2 as imageio
import numpy as np

from mjcf_sandbox.files import whole_file

RATE = 25
"""Frames per second of the video."""


class Video:
    """Writes pairs of views, whole or not at all: the file appears when the video is closed."""

    def __init__(self, path: Path) -> None:
        self._file = whole_file(path)
        beside = self._file.__enter__()
        self._writer = imageio.get_writer(
            beside, fps=RATE, codec="libx264", quality=7, macro_block_size=16
        )

    def add(self, eye: np.ndarray, outside: np.ndarray, title: str, clock: str) -> None:
        """Append one pair of views (480, 640, 3) uint8, with a title and the time."""
        picture = np.ascontiguousarray(np.hstack([eye, outside]))
        width = eye.shape[1]
        for text, x in ((f"what it sees   {clock}", 12), (title, width + 12)):
            cv2.rectangle(picture, (x - 12, 0), (x + 330, 40), (255, 255, 255), cv2.FILLED)
            cv2.putText(picture, text, (x, 27), cv2.FONT_HERSHEY_SIMPLEX, 0.7, (20, 20, 20), 1)
        self._writer.append_data(picture)

    def __enter__(self) -> Video:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._writer.close()
        self._file.__exit__(kind, error, trace)
