"""A camera that is frozen; a marker that is hidden, doubled or mirrored.

The wires tell how the marker moves from frame to frame far better than where it is: the pose that
is expected in a frame is the last pose that was believed, moved as the estimate moved since.
"""

from __future__ import annotations

import zlib
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from jmm_agent.guard.faults import MARKER_HIDDEN, MIRRORED_MARKER, SECOND_MARKER
from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.marker_detector import MarkerPose, Skip


@dataclass(frozen=True)
class CameraMonitorOptions:
    """When pictures are not believed.

    Attributes:
        silence: no new frame for so long, and the camera is frozen [s].
        moved: the same picture of the hand though some wire moved by this is frozen, too [m].
        turned: so is any picture if the camera itself turned by this [rad].
        memory: time over which hidden markers are counted [s].
        hidden_frames: so many frames without the marker within it, and it is hidden.
        still_m, still_rad: as long as the map is not trusted, a marker is only missed if since it
            was seen it moved no further [m], [rad], by the wires.
        margin: how far inside the frame the marker must be expected to be missed [px].
        facing: and its face at most this far from the line of sight [rad].
        mirrored: least angle between the expected and a mirrored pose [rad].
        nearer: one of the two poses is clearly nearer to the expected one by this factor [1].
        longest: a pose that stays mirrored for longer is right, and what was expected wrong [s].
    """

    silence: float = 1.0
    moved: float = 0.005
    turned: float = 0.1
    memory: float = 2.0
    hidden_frames: int = 2
    still_m: float = 0.05
    still_rad: float = 0.15
    margin: float = 70.0
    facing: float = 1.0
    mirrored: float = 0.2
    nearer: float = 0.4
    longest: float = 15.0


class FrozenCameraMonitor:
    """Notices that no new picture comes, or that the newest is an old one."""

    def __init__(self, options: CameraMonitorOptions) -> None:
        self._options = options
        self.reset()

    def reset(self) -> None:
        """Forget all frames."""
        self._came, self._frame_time = np.inf, -np.inf
        self._digest: int | None = None
        self._lengths = np.empty(0)
        self._rotation: Floats | None = None
        self._silent = self._same = False

    def is_new(self, time: float, frame_time: float) -> bool:
        """Whether a frame of ``frame_time`` [s] is newer than all before; called at each step."""
        new = frame_time > self._frame_time
        if new:
            self._came, self._frame_time = time, frame_time
        self._silent = time - self._came > self._options.silence
        return new

    def forget_estimate(self) -> None:
        """The map has changed: how the camera was turned then is not comparable any more."""
        self._rotation = None

    def is_another(
        self,
        frame: np.ndarray,
        lengths: Floats,
        hand_in_view: bool,
        rotation: Floats | None = None,
    ) -> bool:
        """Whether a new frame (H, W, 3) shows another picture than the last one.

        If it does not, but since that picture came first the camera has turned, or the hand is in
        view and wires have moved, the camera is frozen.

        Args:
            frame: (H, W, 3).
            lengths: of the wires (m,) [m].
            hand_in_view: whether the frame shows the hand's marker.
            rotation: of the camera (3, 3) by the wires when the frame was taken; None if unknown.
        """
        options = self._options
        digest = zlib.crc32(np.ascontiguousarray(frame).data)
        if digest != self._digest:
            self._digest, self._lengths, self._same = digest, lengths.copy(), False
            self._rotation = rotation
            return True
        if self._rotation is None:
            self._rotation = rotation
        elif rotation is not None:
            self._same |= _angle(rotation, self._rotation) > options.turned
        moved = float(np.abs(lengths - self._lengths).max())
        self._same |= hand_in_view and moved > options.moved
        return False

    @property
    def frozen(self) -> bool:
        """Whether the camera is frozen."""
        return self._silent or self._same


class MarkerMonitor:
    """Compares each frame with where the marker must be.

    Args:
        camera: that the frames come from.
        options: thresholds.
    """

    def __init__(self, camera: Camera, options: CameraMonitorOptions) -> None:
        self._focal = camera.focal_px
        self._half = np.array([camera.width, camera.height]) / 2.0
        self._options = options
        self.reset()

    def reset(self) -> None:
        """Forget where the marker was."""
        self._hidden: deque[float] = deque()
        self._doubled = self._mirrored = False
        self._mirrored_since = np.inf
        self._seen: Floats | None = None
        self._sighting = np.eye(4)
        self._believed: Floats | None = None

    def forget_estimate(self) -> None:
        """The map has changed: what was believed then is not comparable any more.

        The map changes at rest, so that the marker still is where it was in the last frame when
        the next is believed.
        """
        self._believed = None

    def update(
        self,
        frame_time: float,
        outcome: MarkerPose | Skip,
        believed: Floats | None,
        trusted: bool = True,
    ) -> None:
        """Take what a new frame shows of the marker.

        Args:
            frame_time: when the frame was taken [s].
            outcome: of the detection.
            believed: pose_marker_in_camera (4, 4) by the wires at that time; None if unknown.
            trusted: whether the map is.
        """
        self._doubled = outcome is Skip.TWICE
        if believed is not None:
            self._compare(frame_time, outcome, believed, trusted)
        while self._hidden and frame_time - self._hidden[0] > self._options.memory:
            self._hidden.popleft()

    def _compare(
        self, frame_time: float, outcome: MarkerPose | Skip, believed: Floats, trusted: bool
    ) -> None:
        expected = believed
        if self._seen is not None:
            moved = (
                np.eye(4) if self._believed is None else np.linalg.inv(self._believed) @ believed
            )
            self._seen = expected = self._seen @ moved
        self._believed = believed
        if isinstance(outcome, MarkerPose):
            self._mirrored = self._is_mirrored(outcome, expected)
            since = min(self._mirrored_since, frame_time) if self._mirrored else np.inf
            if frame_time - since > self._options.longest:
                self._mirrored, since = False, np.inf
            self._mirrored_since = since
            if not self._mirrored:
                self._seen = self._sighting = outcome.pose_marker_in_camera
        elif not self._doubled and self._seen is not None:
            known = trusted or self._is_still(expected)
            if known and self._must_be_in_view(expected):
                self._hidden.append(frame_time)

    def found(self) -> Iterator[str]:
        """Kinds of faults that are seen now."""
        if len(self._hidden) >= self._options.hidden_frames:
            yield MARKER_HIDDEN
        if self._doubled:
            yield SECOND_MARKER
        if self._mirrored:
            yield MIRRORED_MARKER

    def _is_mirrored(self, marker: MarkerPose, expected: Floats) -> bool:
        options = self._options
        away = _angle(marker.pose_marker_in_camera, expected)
        other = _angle(marker.flipped_in_camera, expected)
        if self._mirrored:  # until the pose is clearly the right one
            return away > options.nearer * other
        return away > options.mirrored and other < options.nearer * away

    def _is_still(self, pose: Floats) -> bool:
        """Whether the marker, by its pose (4, 4), is about where it was seen last."""
        moved = float(np.linalg.norm(pose[:3, 3] - self._sighting[:3, 3]))
        turned = _angle(pose, self._sighting)
        return moved <= self._options.still_m and turned <= self._options.still_rad

    def _must_be_in_view(self, pose: Floats) -> bool:
        position, normal = pose[:3, 3], pose[:3, 2]
        if position[2] <= 0.0:
            return False
        offset = np.abs(self._focal * position[:2] / position[2])
        facing = np.arccos(np.clip(-normal @ position / np.linalg.norm(position), -1.0, 1.0))
        inside = bool(np.all(offset < self._half - self._options.margin))
        return inside and bool(facing < self._options.facing)


def _angle(pose: Floats, other: Floats) -> float:
    """Angle between the orientations of two poses (4, 4), or of two rotations (3, 3) [rad]."""
    trace = float(np.trace(pose[:3, :3].T @ other[:3, :3]))
    return float(np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0)))
