"""Poses of AR markers in a camera frame (Kawaharazuka et al. 2018, sec. III-C, step 1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import cv2
import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.marker_corners import locate_corners
from jmm_agent.vision.marker_in_view import corners_px, is_shown
from jmm_agent.vision.marker_input import check_frame, check_markers, predicted_poses
from jmm_agent.vision.marker_search import (
    Candidate,
    MarkerSearch,
    close,
    overlap,
    side_of,
)
from jmm_agent.vision.marker_view import MarkerView
from jmm_agent.vision.square_pose import (
    alike,
    either_covariance,
    solve_square,
    square_corners,
    square_covariance,
)

SQUARE_PX = 0.4
"""Corners farther than this from those of a square are not the marker's [px] ..."""
SQUARE_SHARE = 0.004
"""... or than this share of the marker's mean side ..."""
SQUARE_DEVIATIONS = 3.0
"""... or than this number of standard deviations of a corner."""
AWAY = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]])
"""Pose of a marker whose face is turned away from the camera."""
REGION_SIDES = 2.0
"""A marker that is not found at once is searched this far around its predicted pose [sides]."""


class Skip(Enum):
    """Why an expected marker has no pose in a frame."""

    DARK = "the frame is black"
    NOT_SEEN = "the marker is not in the frame"
    TWICE = "the marker is in the frame more than once"
    UNCLEAR = "the marker's edges are partly hidden, cut off or too blurred for straight lines"
    NO_POSE = (
        "the marker's corners fit no square in front of the camera: the intrinsics or the "
        "distortion are not those of the camera, the marker is bent, or a corner is hidden"
    )


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
        covariance: of the pose (6, 6): x, y, z [m] and rotations about x, y and z [rad] in the
            camera's axes, from the errors of the corners; None if they are unknown. If the pose is
            ambiguous and none was predicted, it includes the distance to the second solution.
        deviation_px: standard deviation of a corner's coordinate; 0 if it is unknown.
    """

    id: int
    pose_marker_in_camera: np.ndarray
    corners_px: np.ndarray
    reprojection_px: float
    flipped_in_camera: np.ndarray
    flipped_reprojection_px: float
    covariance: Floats | None = None
    deviation_px: float = 0.0

    @property
    def ambiguous(self) -> bool:
        """Whether both poses fit the corners alike: which is right, the frame does not tell.

        A predicted pose decides between them; without one the marker may lie at either.
        """
        return alike(self.reprojection_px, self.flipped_reprojection_px, self.deviation_px)


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
    """Finds ArUco and AprilTag markers, and their poses from lines along the square's edges.

    Args:
        camera: model of the camera that the frames come from.
        side_by_id: side of the black square of each expected marker [m].
        dictionary: name of a predefined dictionary of OpenCV, such as ``DICT_5X5_100`` or
            ``DICT_APRILTAG_36h11``.
        border: width of the black border [cells].

    Raises:
        AgentError: there is no camera, no marker or no such dictionary, or an id, a side or the
            border is impossible.
    """

    def __init__(
        self,
        camera: Camera,
        side_by_id: Mapping[int, float],
        dictionary: str = "DICT_4X4_50",
        border: int = 1,
    ) -> None:
        if not isinstance(camera, Camera):
            raise AgentError(f"A marker detector needs a Camera, got {type(camera).__name__}.")
        self._search = MarkerSearch(dictionary, border)
        check_markers(side_by_id, dictionary, self._search.count)
        self._camera = camera
        self._square_by_id = {
            marker_id: square_corners(float(side)) for marker_id, side in side_by_id.items()
        }

    def __deepcopy__(self, memo: dict[int, object]) -> MarkerDetector:
        """This detector itself: it has no state, and OpenCV's dictionaries cannot be copied."""
        return self

    def detect(
        self, frame_rgb: np.ndarray, expected: Mapping[int, np.ndarray] | None = None
    ) -> Detections:
        """Find the poses of the expected markers.

        Args:
            frame_rgb: (H, W, 3) uint8 of the camera's size.
            expected: predicted pose_marker_in_camera (4, 4) of some ids; it decides between the two
                solutions for a plane if both fit the corners alike. Markers that a first pass does
                not find are searched further: near their predicted poses if any are given, in the
                whole frame otherwise.

        Raises:
            AgentError: the frame or a predicted pose has a wrong shape, type or value.
        """
        check_frame(frame_rgb, self._camera)
        expected = predicted_poses(expected, self._square_by_id)
        gray = cv2.cvtColor(frame_rgb, cv2.COLOR_RGB2GRAY)
        if not gray.any():
            return Detections({}, dict.fromkeys(self._square_by_id, Skip.DARK), ())
        found = self._search.first(gray)
        outcome = {
            marker_id: self._locate(marker_id, gray, found, expected)
            for marker_id in self._square_by_id
        }
        for marker_id, skip in outcome.items():
            if isinstance(skip, Skip) and skip is not Skip.TWICE:
                outcome[marker_id] = self._search_further(marker_id, gray, found, skip, expected)
        return Detections(
            {i: o for i, o in outcome.items() if isinstance(o, MarkerPose)},
            {i: o for i, o in outcome.items() if isinstance(o, Skip)},
            tuple(sorted({i for i, _ in found} - set(self._square_by_id))),
        )

    def shows(self, marker_id: int, pose: Floats) -> bool:
        """Whether a frame shows a marker; see `PredictingDetector`."""
        return is_shown(self._camera, self._square_by_id[marker_id], pose)

    def _search_further(
        self,
        marker_id: int,
        gray: np.ndarray,
        found: list[Candidate],
        skip: MarkerPose | Skip,
        expected: Mapping[int, Floats],
    ) -> MarkerPose | Skip:
        """Pose of a marker that the first pass does not find, or why it has none."""
        left, top, region = self._region(marker_id, gray, expected)
        if not region.size:
            return skip
        tried = [quad for i, quad in found if i == marker_id]
        for candidates in self._search.further(region):
            moved = [(i, quad + np.array([left, top])) for i, quad in candidates]
            outcome = self._locate(marker_id, gray, moved, expected, tried)
            tried += [quad for i, quad in moved if i == marker_id]
            if isinstance(outcome, MarkerPose) or outcome is Skip.TWICE:
                return outcome
            if skip is Skip.NOT_SEEN:
                skip = outcome
        return skip

    def _region(
        self, marker_id: int, gray: np.ndarray, expected: Mapping[int, Floats]
    ) -> tuple[int, int, np.ndarray]:
        """Left and top [px] of the part of a frame that may show a marker, and this part."""
        if not expected:
            return 0, 0, gray
        square, pose = self._square_by_id[marker_id], expected.get(marker_id, AWAY)
        pixels = corners_px(self._camera, square, pose)
        if not np.isfinite(pixels).all():
            return 0, 0, gray[:0]
        reach = REGION_SIDES * float(np.ptp(pixels, axis=0).max())
        size = np.array(gray.shape[::-1])
        low = np.clip(np.floor(pixels.min(axis=0) - reach), 0, size).astype(int)
        high = np.clip(np.ceil(pixels.max(axis=0) + reach), 0, size).astype(int)
        return int(low[0]), int(low[1]), gray[low[1] : high[1], low[0] : high[0]]

    def _locate(
        self,
        marker_id: int,
        gray: np.ndarray,
        candidates: list[Candidate],
        expected: Mapping[int, Floats],
        tried: Sequence[Floats] = (),
    ) -> MarkerPose | Skip:
        """Pose of one marker from rough corners that were not tried yet, or why it has none."""
        quads = [quad for i, quad in candidates if i == marker_id]
        if not all(overlap(quad, quads[0]) for quad in quads):
            return Skip.TWICE
        outcome: MarkerPose | Skip = Skip.NOT_SEEN
        for quad in quads:
            if not any(close(quad, other) for other in tried):
                outcome = self._measure(marker_id, gray, quad, expected)
                if isinstance(outcome, MarkerPose):
                    break
        return outcome

    def _measure(
        self, marker_id: int, gray: np.ndarray, rough: Floats, expected: Mapping[int, Floats]
    ) -> MarkerPose | Skip:
        """Pose of one marker from rough corners (4, 2) [px], or why it has none."""
        view = MarkerView(self._camera, rough)
        quad = view.view_px(rough)
        if not np.isfinite(quad).all():
            return Skip.UNCLEAR
        corners = locate_corners(gray, quad, self._search.pattern(marker_id), view)
        if corners is None:
            return Skip.UNCLEAR
        square, predicted = self._square_by_id[marker_id], expected.get(marker_id)
        found = solve_square(
            square,
            corners.points,
            view.matrix,
            None if predicted is None else view.in_view(predicted),
            corners.deviation_px,
        )
        tolerance = max(
            SQUARE_PX,
            SQUARE_SHARE * side_of(corners.points),
            SQUARE_DEVIATIONS * corners.deviation_px,
        )
        if found is None or not found.error_px < tolerance:
            return Skip.NO_POSE
        covariance = square_covariance(found.pose, square, view.matrix, corners.covariance)
        unsure = alike(found.error_px, found.flipped_error_px, corners.deviation_px)
        if predicted is None and unsure:
            covariance = either_covariance(covariance, found.pose, found.flipped)
        return MarkerPose(
            marker_id,
            view.in_camera(found.pose),
            view.frame_px(corners.points),
            found.error_px,
            view.in_camera(found.flipped),
            found.flipped_error_px,
            view.covariance_in_camera(covariance),
            corners.deviation_px,
        )
