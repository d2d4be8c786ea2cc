"""Frames that hold the pose of the hand's marker as bytes, in place of pictures.

The faults of this experiment are those of processes and lines. So no camera is rendered, which
would take most of the time.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from jmm_agent.types import Floats
from jmm_agent.vision.marker_detector import Detections, MarkerPose

SHAPE = (1, 43, 3)
"""Shape of a frame; 129 bytes, of which a pose (4, 4) takes 128."""
POSE_BYTES = 128


def frame_of(pose: Floats) -> np.ndarray:
    """Frame with a pose_marker_in_camera (4, 4)."""
    data = np.asarray(pose, dtype=float).tobytes().ljust(int(np.prod(SHAPE)), b"\0")
    return np.frombuffer(data, np.uint8).reshape(SHAPE)


class PoseDetector:
    """A `jmm_agent.Detector` of these frames: one marker, without error."""

    def detect(
        self, frame_rgb: np.ndarray, expected: Mapping[int, np.ndarray] | None = None
    ) -> Detections:
        """The pose in a frame, as that of marker 0."""
        pose = np.frombuffer(frame_rgb.tobytes()[:POSE_BYTES]).reshape(4, 4)
        marker = MarkerPose(0, pose, np.zeros((4, 2)), 0.0, pose, np.inf)
        return Detections({0: marker}, {}, ())
