"""The marker on the hand: where the kinematics expect it, and where a frame shows it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats
from jmm_agent.vision.marker_detector import Detections, Detector, MarkerPose, Skip
from jmm_agent.vision.marker_in_view import PredictingDetector


class FrameJob(NamedTuple):
    """A camera frame, and what was known when it arrived.

    Attributes:
        time: at which the frame was taken [s].
        frame: (H, W, 3) uint8.
        q: estimated joint angles (n,) [rad]; they predict the pose of the hand's marker.
        lengths: measured muscle lengths (m,) [m].
    """

    time: float
    frame: np.ndarray
    q: Floats
    lengths: Floats

    @property
    def kind(self) -> str:
        """Name of such jobs among others."""
        return "frame"


class FrameMarkers(Protocol):
    """Finds the hand's marker in frames, at once or until a later control step."""

    def pose(self, q: Floats) -> Floats:
        """Expected pose_marker_in_camera (4, 4) at joint angles (n,) [rad]."""

    def submit(self, job: FrameJob) -> None:
        """Detect the markers of a frame.

        Args:
            job: the frame.

        Raises:
            AgentError: the frame has a wrong shape or type.
        """

    def results(self) -> list[tuple[FrameJob, Detections]]:
        """Detections that are new in this control step."""

    def outcome(self, detections: Detections) -> MarkerPose | Skip:
        """The hand's marker, or why it has no pose."""


class HandMarker:
    """Finds the hand's marker in camera frames (paper, sec. III-C, step 1).

    Args:
        detector: finds markers in frames.
        kinematics: of all joints between camera and marker.
        number: id of the hand's marker.
        camera: the camera's frame in the kinematics.
        site: the site that carries the marker.
    """

    def __init__(
        self, detector: Detector, kinematics: ArmKinematics, number: int, camera: str, site: str
    ) -> None:
        self._detector, self._kinematics = detector, kinematics
        self._number, self._camera, self._site = number, camera, site
        self._newest: tuple[np.ndarray, Floats, Detections] | None = None
        self._results: list[tuple[FrameJob, Detections]] = []

    def pose(self, q: Floats) -> Floats:
        """Expected pose_marker_in_camera (4, 4) at joint angles (n,) [rad]."""
        return self._kinematics.pose(self._site, q, relative_to=self._camera)

    def detect(self, frame: np.ndarray, q: Floats) -> Detections:
        """All markers in a frame.

        Args:
            frame: (H, W, 3) uint8.
            q: estimated joint angles (n,) [rad]; they predict the pose of the hand's marker.

        Raises:
            AgentError: the frame has a wrong shape or type.
        """
        if self._newest is not None:
            newest, at, detections = self._newest
            if frame is newest and np.array_equal(q, at):
                return detections
        detections = self.detect_at(frame, self.pose(q))
        self._newest = frame, q, detections
        return detections

    def detect_at(self, frame: np.ndarray, pose: Floats) -> Detections:
        """All markers in a frame.

        Args:
            frame: (H, W, 3) uint8.
            pose: expected pose_marker_in_camera (4, 4).

        Raises:
            AgentError: the frame has a wrong shape or type.
        """
        return self._detector.detect(frame, {self._number: pose})

    def find(self, frame: np.ndarray, q: Floats) -> MarkerPose | Skip:
        """The hand's marker in a frame, or why it has no pose; see `detect`."""
        return self.outcome(self.detect(frame, q))

    def outcome(self, detections: Detections) -> MarkerPose | Skip:
        """The hand's marker, or why it has no pose."""
        if self._number in detections.poses:
            return detections.poses[self._number]
        return detections.skips[self._number]

    @property
    def shows(self) -> Callable[[Floats], bool] | None:
        """Whether a frame shows the hand's marker at a pose in the camera (4, 4); None: unknown."""
        if not isinstance(self._detector, PredictingDetector):
            return None
        return partial(self._detector.shows, self._number)

    def submit(self, job: FrameJob) -> None:
        """Detect the markers of a frame at once; see `FrameMarkers`."""
        self._results.append((job, self.detect(job.frame, job.q)))

    def results(self) -> list[tuple[FrameJob, Detections]]:
        """Detections since the last call."""
        results, self._results = self._results, []
        return results
