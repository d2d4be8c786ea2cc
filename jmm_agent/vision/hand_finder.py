"""Finder of the hand in camera frames: what the agent needs of it, however the hand is found.

There are two: `HandMarker` finds the marker on the hand, `HandShape` the hand itself.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Literal, NamedTuple, Protocol

import numpy as np

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats
from jmm_agent.vision.hand_detection import HandDetection
from jmm_agent.vision.marker_detector import MarkerPose
from jmm_agent.vision.marker_observation import Frames


class FrameJob(NamedTuple):
    """A camera frame, and what was known when it arrived.

    Attributes:
        time: at which the frame was taken [s].
        frame: (H, W, 3) uint8.
        q: estimated joint angles (n,) [rad]; they predict the pose of the hand.
        lengths: measured muscle lengths (m,) [m].
        exposed: estimated joint angles (n,) [rad] at its time; None: ``q``.
    """

    time: float
    frame: np.ndarray
    q: Floats
    lengths: Floats
    exposed: Floats | None = None

    @property
    def kind(self) -> str:
        """Name of such jobs among others."""
        return "frame"


class HandSeen(NamedTuple):
    """The hand in a frame.

    Attributes:
        pose: (4, 4) in the camera, translation in metres.
        frames: whose pose it is, and the camera; None: the hand's marker.
        covariance: of the pose (6, 6), see `pose_covariance`; None: that of a marker in a frame.
        flipped: another pose (4, 4) that the frame allows, if there is one.
        side_px: largest side of what was found, as far as it is known [px].
    """

    pose: Floats
    frames: Frames | None = None
    covariance: Floats | None = None
    flipped: Floats | None = None
    side_px: float = 0.0


class HandMissed(NamedTuple):
    """A frame without a pose of the hand.

    Attributes:
        kind: "absent": it is not in the frame, or covered; "doubled": more than one could be it;
            "mirrored"; "unclear": it is there, but its pose is not known.
        reason: in some words.
    """

    kind: Literal["absent", "doubled", "mirrored", "unclear"]
    reason: str


Hand = HandSeen | HandMissed


class Findings(NamedTuple):
    """What was found in a frame.

    Attributes:
        hand: the hand; None if it was not searched.
        markers: by id; None if they were not searched.
        hands: that are seen without a marker, one of which may be the own one.
    """

    hand: Hand | None
    markers: dict[int, MarkerPose] | None
    hands: tuple[HandDetection, ...] = ()


FoundBy = Literal["marker", "hand"]
"""What is found of the hand: the marker on it, or the hand itself."""


class FrameFinder(Protocol):
    """Finds the hand in frames, at once or until a later control step."""

    @property
    def what(self) -> FoundBy:
        """What is found."""

    @property
    def around(self) -> Callable[[Floats], bool] | None:
        """Whether a frame shows the hand at a pose (4, 4); None: from the front of a marker."""

    def pose(self, q: Floats) -> Floats:
        """Expected pose (4, 4) of the hand in the camera at joint angles (n,) [rad]."""

    def submit(self, job: FrameJob) -> None:
        """Find the hand in a frame.

        Args:
            job: the frame.

        Raises:
            AgentError: the frame has a wrong shape or type.
        """

    def results(self) -> list[tuple[FrameJob, Hand]]:
        """Frames that were searched, and are new in this control step."""


class HandFinder(ABC):
    """Finds the hand in camera frames (paper, sec. III-C, step 1).

    Args:
        kinematics: of all joints between camera and hand.
        frame: whose pose is found.
        camera: the camera's frame in the kinematics.
        position_noise: usual standard deviation of the hand's position [m].

    Attributes:
        what: what is found.
        missing: why nothing is learned where there is no frame.
        frames: whose pose is found, and the camera.
        position_noise: as given.
    """

    what: FoundBy
    missing: str

    def __init__(
        self, kinematics: ArmKinematics, frame: str, camera: str, position_noise: float
    ) -> None:
        self._kinematics, self.frames = kinematics, (frame, camera)
        self.position_noise = position_noise
        self._newest: tuple[np.ndarray, Floats, Findings] | None = None
        self._results: list[tuple[FrameJob, Hand]] = []
        self._q: Floats | None = None

    @property
    @abstractmethod
    def shows(self) -> Callable[[Floats], bool] | None:
        """Whether a frame shows the hand at a pose in the camera (4, 4); None: unknown."""

    @property
    def around(self) -> Callable[[Floats], bool] | None:
        """See `FrameFinder`."""
        return None

    @abstractmethod
    def find_at(self, frame: np.ndarray, pose: Floats) -> Findings:
        """The hand in a frame, whatever was seen before; another thread may call this.

        Args:
            frame: (H, W, 3) uint8.
            pose: expected pose of the hand in the camera (4, 4).

        Raises:
            AgentError: the frame has a wrong shape or type.
        """

    def pose(self, q: Floats) -> Floats:
        """Expected pose (4, 4) of the hand in the camera at joint angles (n,) [rad]."""
        return self._kinematics.pose(self.frames[0], q, relative_to=self.frames[1])

    def chosen(self, found: Findings, q: Floats) -> Findings:
        """What was found in a frame, by what was seen before; once for each frame, in order.

        Args:
            found: as `find_at` returned it.
            q: estimated joint angles (n,) [rad] at the time of the frame.
        """
        return found

    def follow(self, q: Floats) -> None:
        """Take note of the estimated joint angles (n,) [rad] of a control step."""
        self._q = q

    def map_changed(self) -> None:
        """Take note that the next joint angles are estimated with another map."""
        self._newest = None

    def reset(self) -> None:
        """Forget all frames, as before a new episode."""
        self._newest, self._results, self._q = None, [], None

    def find(self, frame: np.ndarray, q: Floats, exposed: Floats | None = None) -> Findings:
        """The hand in a frame, once for the same one.

        Args:
            frame: (H, W, 3) uint8.
            q: estimated joint angles (n,) [rad]; they predict the pose of the hand.
            exposed: those at the time of the frame; None: ``q``.

        Raises:
            AgentError: the frame has a wrong shape or type.
        """
        if self._newest is not None:
            newest, at, found = self._newest
            if frame is newest and np.array_equal(q, at):
                return found
        found = self.chosen(self.find_at(frame, self.pose(q)), q if exposed is None else exposed)
        self._newest = frame, q, found
        return found

    def find_markers(self, frame: np.ndarray, q: Floats) -> Findings:
        """The markers in a frame, and the hand if it is found with them; see `find`."""
        return self.find(frame, q)

    def submit(self, job: FrameJob) -> None:
        """Find the hand in a frame at once; see `FrameFinder`."""
        hand = self.find(job.frame, job.q, job.exposed).hand
        assert hand is not None
        self._results.append((job, hand))

    def results(self) -> list[tuple[FrameJob, Hand]]:
        """What was found since the last call."""
        results, self._results = self._results, []
        return results
