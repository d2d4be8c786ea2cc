"""Poses of AR markers in a camera frame (Kawaharazuka et al. 2018, sec. III-C, step 1)."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import cv2
import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.corner_refinement import refine_corners

CELLS = 6  # of a DICT_4X4 marker: 4 cells of code between two of black border
ALIKE = 2.0  # two solutions fit alike if their errors differ by less than this factor ...
NOISE_PX = 0.03  # ... or if both errors are below this
SQUARE_PX = 0.4  # corners farther than this from those of a square are not the marker's

# OpenCV's rotation vectors fail at half a turn, the rotation of an upright marker that faces the
# camera. So poses are computed in a frame that is turned in steps of 90 deg until it is nearly
# level with the camera (x right, y down, z forward): pose_level_in_marker (4, 4), by the first
# corner in the image.
LEVEL_IN_MARKER = [
    np.array([[c, -s, 0, 0], [-s, -c, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1.0]])
    for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))
]


class Skip(Enum):
    """Why an expected marker has no pose in a frame."""

    DARK = "the frame is black"
    NOT_SEEN = "the marker is not in the frame"
    TWICE = "the marker is in the frame more than once"
    UNCLEAR = "the marker's edges are partly hidden, cut off or too blurred for straight lines"
    NO_POSE = "the marker's corners fit no square in front of the camera"


@dataclass(frozen=True)
class MarkerPose:
    """One marker in one frame. Marker axes: x right and y up as printed, z out of the face.

    Attributes:
        id: number of the marker in its dictionary.
        pose_marker_in_camera: (4, 4), metres; camera x right, y down, z forward.
        corners_px: (4, 2), from the printed upper left one, clockwise as printed.
        reprojection_px: RMS distance of the four corners from those of the pose.
        flipped_in_camera: (4, 4), the second solution for a plane by IPPE, whose normal is nearly
            mirrored at the line of sight; the only solution if there is no second one.
        flipped_reprojection_px: RMS distance of the four corners from those of that pose.
    """

    id: int
    pose_marker_in_camera: np.ndarray
    corners_px: np.ndarray
    reprojection_px: float
    flipped_in_camera: np.ndarray
    flipped_reprojection_px: float

    @property
    def ambiguous(self) -> bool:
        """Whether both poses fit the corners alike."""
        return _alike(self.reprojection_px, self.flipped_reprojection_px)


@dataclass(frozen=True)
class Detections:
    """Markers in a frame: every expected id is a key of exactly one of `poses` and `skips`.

    Attributes:
        poses: markers with a pose.
        skips: markers without a pose, and why.
        unexpected: ids in the frame that are not expected, ascending.
    """

    poses: dict[int, MarkerPose]
    skips: dict[int, Skip]
    unexpected: tuple[int, ...]


class Detector(Protocol):
    """Interface of the objects that find markers in frames."""

    def detect(
        self, frame_rgb: np.ndarray, expected: Mapping[int, np.ndarray] | None = None
    ) -> Detections:
        """Poses of the expected markers; see `MarkerDetector.detect`.

        Args:
            frame_rgb: (H, W, 3) uint8.
            expected: predicted pose_marker_in_camera (4, 4) of some ids.
        """


class MarkerDetector:
    """Finds ArUco markers (DICT_4X4_50), and their poses from lines along the black square's edges.

    Args:
        camera: model of the camera that the frames come from.
        side_by_id: side of the black square of each expected marker [m].

    Raises:
        AgentError: there is no marker, an id is outside 0 to 49, or a side is not positive and
            finite.
    """

    def __init__(self, camera: Camera, side_by_id: Mapping[int, float]):
        if not side_by_id:
            raise AgentError(
                "A marker detector needs at least one marker id with its side in metres."
            )
        for marker_id, side in side_by_id.items():
            if not 0 <= marker_id < 50:
                raise AgentError(
                    f"Marker id {marker_id} is not in DICT_4X4_50; ids go from 0 to 49."
                )
            if not (np.isfinite(side) and side > 0):
                raise AgentError(
                    f"The side of marker {marker_id} is {side} m; it must be positive and finite."
                )
        self._camera = camera
        self._square_by_id = {marker_id: _square(side) for marker_id, side in side_by_id.items()}
        parameters = cv2.aruco.DetectorParameters()
        # One pass; a smaller window would take a near marker's border for an empty ring.
        parameters.adaptiveThreshWinSizeMin = parameters.adaptiveThreshWinSizeMax = 43
        parameters.minMarkerDistanceRate = (
            0.02  # so that a chequered ground does not swallow the marker
        )
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
        self._aruco = cv2.aruco.ArucoDetector(dictionary, parameters)

    def detect(
        self, frame_rgb: np.ndarray, expected: Mapping[int, np.ndarray] | None = None
    ) -> Detections:
        """Find the poses of the expected markers.

        Args:
            frame_rgb: (H, W, 3) uint8 of the camera's size.
            expected: predicted pose_marker_in_camera (4, 4) of some ids; it decides between the two
                solutions for a plane if both fit the corners alike.

        Raises:
            AgentError: the frame or a predicted pose has a wrong shape, type or value.
        """
        expected = expected or {}
        self._check(frame_rgb, expected)
        gray = cv2.cvtColor(frame_rgb, cv2.COLOR_RGB2GRAY)
        if not gray.any():
            return Detections({}, dict.fromkeys(self._square_by_id, Skip.DARK), ())
        quads, found, _ = self._aruco.detectMarkers(gray)
        ids = [] if found is None else [int(i) for i in found.ravel()]
        outcome = {
            marker_id: self._locate(
                marker_id,
                gray,
                [q[0] for q, i in zip(quads, ids, strict=True) if i == marker_id],
                expected,
            )
            for marker_id in self._square_by_id
        }
        return Detections(
            {i: o for i, o in outcome.items() if isinstance(o, MarkerPose)},
            {i: o for i, o in outcome.items() if isinstance(o, Skip)},
            tuple(sorted(set(ids) - set(self._square_by_id))),
        )

    def _locate(
        self,
        marker_id: int,
        gray: np.ndarray,
        quads: list[np.ndarray],
        expected: Mapping[int, np.ndarray],
    ) -> MarkerPose | Skip:
        """Pose of one marker from its rough corners (4, 2) [px], or why it has none."""
        if len(quads) != 1:
            return Skip.TWICE if quads else Skip.NOT_SEEN
        corners = refine_corners(gray, quads[0], CELLS)
        if corners is None:
            return Skip.UNCLEAR
        square = self._square_by_id[marker_id]
        first = int(np.argmax(np.roll(corners, -1, axis=0)[:, 0] - corners[:, 0]))
        level = LEVEL_IN_MARKER[first]
        image = np.roll(corners, -first, axis=0)[::-1].copy()
        _, turns, shifts, _ = cv2.solvePnPGeneric(
            square, image, self._camera.matrix, None, flags=cv2.SOLVEPNP_IPPE_SQUARE
        )
        poses = [_pose(turn, shift) @ level.T for turn, shift in zip(turns, shifts, strict=True)]
        poses.sort(key=lambda pose: self._error(pose, square, corners))
        if not poses:
            return Skip.NO_POSE
        chosen, flipped = poses[0], poses[-1]
        errors = [self._error(pose, square, corners) for pose in (chosen, flipped)]
        predicted = expected.get(marker_id)
        if (
            predicted is not None
            and _alike(*errors)
            and _angle(flipped, predicted) < _angle(chosen, predicted)
        ):
            chosen, flipped = flipped, chosen
        start = chosen @ level
        turn, shift = cv2.solvePnPRefineLM(
            square, image, self._camera.matrix, None, cv2.Rodrigues(start[:3, :3])[0], start[:3, 3:]
        )
        pose = _pose(turn, shift) @ level.T
        error = self._error(pose, square, corners)
        if not error < SQUARE_PX:
            return Skip.NO_POSE
        flipped_error = self._error(flipped, square, corners)
        return MarkerPose(marker_id, pose, corners, error, flipped, flipped_error)

    def _error(self, pose: np.ndarray, square: np.ndarray, corners: np.ndarray) -> float:
        """RMS distance [px] of the corners from the square at `pose`; inf if behind the camera."""
        image = self._camera.matrix @ (pose[:3, :3] @ square.T + pose[:3, 3:])
        if not (np.isfinite(image).all() and (image[2] > 0).all()):
            return float("inf")
        return float(np.sqrt(np.sum((image[:2] / image[2] - corners.T) ** 2) / 4))

    def _check(self, frame: np.ndarray, expected: Mapping[int, np.ndarray]) -> None:
        shape = (self._camera.height, self._camera.width, 3)
        if not isinstance(frame, np.ndarray) or frame.shape != shape or frame.dtype != np.uint8:
            was = (
                f"{frame.dtype} of shape {frame.shape}"
                if isinstance(frame, np.ndarray)
                else type(frame).__name__
            )
            raise AgentError(
                f"The camera frame is {was}; it must be a uint8 array of shape {shape}."
            )
        for marker_id, pose in expected.items():
            if marker_id not in self._square_by_id:
                raise AgentError(
                    f"A pose is predicted for marker {marker_id}, but expected are only "
                    f"{sorted(self._square_by_id)}."
                )
            if np.shape(pose) != (4, 4) or not np.isfinite(pose).all():
                raise AgentError(
                    f"The predicted pose of marker {marker_id} must be finite and of shape (4, 4)."
                )


def _square(side: float) -> np.ndarray:
    """Corners (4, 3) of the black square in the marker's frame, in ArUco's and IPPE's order."""
    return (
        side
        / 2
        * np.array([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0]])
    )


def _pose(turn: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Pose (4, 4) from a rotation vector (3, 1) and a translation (3, 1)."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(turn)[0], shift[:, 0]
    return pose


def _alike(error: float, other: float) -> bool:
    return max(error, other) < max(NOISE_PX, ALIKE * min(error, other))


def _angle(pose: np.ndarray, other: np.ndarray) -> float:
    """Angle between two orientations [rad]."""
    return float(np.arccos(np.clip((np.trace(pose[:3, :3].T @ other[:3, :3]) - 1) / 2, -1, 1)))
