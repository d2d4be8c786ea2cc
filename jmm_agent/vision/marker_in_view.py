"""Where a camera shows a marker, and whether it does."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np

from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera

FACING = 0.1
"""A marker with a cosine below this to the line of sight counts as turned away."""


@runtime_checkable
class PredictingDetector(Protocol):
    """A detector that says whether a frame would show a marker, as `MarkerDetector` does."""

    def shows(self, marker_id: int, pose: np.ndarray) -> bool:
        """Whether a frame shows all of a marker, from its front.

        Args:
            marker_id: its id.
            pose: pose_marker_in_camera (4, 4).
        """


def corners_px(camera: Camera, square: Floats, pose: Floats) -> Floats:
    """Pixels (4, 2) of a marker's corners; NaN if it is behind the camera or turned away.

    Args:
        camera: that takes the frames.
        square: corners in the marker's axes (4, 3) [m].
        pose: pose_marker_in_camera (4, 4).
    """
    towards = -float(pose[:3, 2] @ pose[:3, 3])
    if towards < FACING * float(np.linalg.norm(pose[:3, 3])):
        return np.full((len(square), 2), np.nan)
    return camera.project(square @ pose[:3, :3].T + pose[:3, 3])


def is_shown(camera: Camera, square: Floats, pose: Floats) -> bool:
    """Whether a frame shows all of a marker, from its front; see `corners_px`."""
    size = np.array([camera.width - 1.0, camera.height - 1.0])
    pixels = corners_px(camera, square, pose)
    return bool(np.all((pixels >= 0.0) & (pixels <= size)))  # NaN: no
