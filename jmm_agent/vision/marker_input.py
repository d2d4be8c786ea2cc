"""Checks of what a marker detector is given: markers, frames and predicted poses."""

from __future__ import annotations

from collections.abc import Mapping
from reprlib import repr as short

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.plain_numbers import is_real, is_whole

LARGEST_SIDE = 5.0
"""Largest side of a marker [m]; a larger number is one in millimetres."""
RIGID = 1e-3
"""Largest error of a predicted rotation's orthogonality [1]."""


def check_markers(side_by_id: Mapping[int, float], dictionary: str, count: int) -> None:
    """Refuse impossible markers.

    Args:
        side_by_id: side of the black square of each expected marker [m].
        dictionary: its name, for messages.
        count: number of markers in the dictionary.

    Raises:
        AgentError: there is no marker, an id is not in the dictionary, or a side is not above 0 and
            up to `LARGEST_SIDE`.
    """
    if not (isinstance(side_by_id, Mapping) and side_by_id):
        raise AgentError(
            "A marker detector needs at least one marker id with its side in metres, such as "
            f"{{0: 0.05}}, got {side_by_id!r}."
        )
    for marker_id, side in side_by_id.items():
        if not (is_whole(marker_id) and 0 <= marker_id < count):
            raise AgentError(
                f"Marker id {marker_id!r} is not in {dictionary}; ids are whole numbers from 0 "
                f"to {count - 1}."
            )
        is_number = is_real(side)
        if not (is_number and 0 < side <= LARGEST_SIDE):
            raise AgentError(
                f"The side of marker {marker_id} is {side!r}; it must be a number of metres "
                f"above 0 and up to {LARGEST_SIDE:g}."
            )


def check_frame(frame: np.ndarray, camera: Camera) -> None:
    """Refuse a frame that is not one of a camera.

    Args:
        frame: the frame.
        camera: the camera.

    Raises:
        AgentError: the frame has a wrong shape or type.
    """
    shape = (camera.height, camera.width, 3)
    if not isinstance(frame, np.ndarray) or frame.shape != shape or frame.dtype != np.uint8:
        was = (
            f"{frame.dtype} of shape {frame.shape}"
            if isinstance(frame, np.ndarray)
            else type(frame).__name__
        )
        raise AgentError(f"The camera frame is {was}; it must be a uint8 array of shape {shape}.")


def predicted_poses(
    expected: Mapping[int, np.ndarray] | None, ids: Mapping[int, object]
) -> dict[int, Floats]:
    """Predicted poses as arrays (4, 4), by id.

    Args:
        expected: predicted pose_marker_in_camera (4, 4) of some ids; None: of none.
        ids: the detector's markers.

    Raises:
        AgentError: a marker is not the detector's, or its pose is no pose.
    """
    if expected is None:
        return {}
    if not isinstance(expected, Mapping):
        raise AgentError(
            "Predicted poses are expected by marker id, such as {0: pose_marker_in_camera}, got "
            f"{type(expected).__name__}."
        )
    poses = {}
    for marker_id, pose in expected.items():
        if marker_id not in ids:
            raise AgentError(
                f"A pose is predicted for marker {short(marker_id)}, but expected are only "
                f"{sorted(ids)}."
            )
        try:
            array = np.asarray(pose, dtype=float)
        except (TypeError, ValueError):
            array = np.empty(0)
        if array.shape != (4, 4) or not np.isfinite(array).all():
            raise AgentError(
                f"The predicted pose of marker {marker_id} must be finite and of shape (4, 4)."
            )
        turn = array[:3, :3]
        if not (np.abs(turn).max() < 2 and np.abs(turn @ turn.T - np.eye(3)).max() < RIGID):
            raise AgentError(
                f"The predicted pose of marker {marker_id} is no pose: its upper left 3 x 3 "
                "numbers are no rotation."
            )
        poses[marker_id] = array
    return poses
