"""Monitors of a frozen camera, and of a hand in its frames that is hidden, doubled or mirrored.

The estimated joint angles show how the hand moves from frame to frame far better than where it is.
So the pose that is expected in a frame is the last pose that was believed, moved as the predicted
pose moved since. "Marker" below stands for the hand that is found without one, too.

What looks like the hand may be another robot's, or a picture. It does not move with the arm: from
one frame to another the own hand moves by d as predicted, but for an error that is a share of d,
because the map may be wrong, and the errors of both poses. A movement for which a picture at rest
would not show is judged together with the next ones.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum, auto
from statistics import median
from typing import NamedTuple

import numpy as np

from jmm_agent.guard.faults import (
    HAND_HIDDEN,
    MARKER_HIDDEN,
    MIRRORED_HAND,
    MIRRORED_MARKER,
    OTHER_HAND,
    SECOND_HAND,
    SECOND_MARKER,
)
from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.hand_finder import FoundBy, Hand, HandMissed, HandSeen
from jmm_agent.vision.square_pose import angle_between

FRAMES = 5
"""Number of newest times between frames whose median is the usual one."""

ROWS = 16
"""Number of rows of two frames that are compared at once."""

KINDS: Mapping[FoundBy, tuple[str, str, str, str]] = {
    "marker": (MARKER_HIDDEN, SECOND_MARKER, MIRRORED_MARKER, OTHER_HAND),
    "hand": (HAND_HIDDEN, SECOND_HAND, MIRRORED_HAND, OTHER_HAND),
}
"""Kinds of faults of a hand that is hidden, doubled, mirrored, or another one, by what is found."""

DEVIATIONS = 3.0
"""Standard deviations by which the poses of a hand that follows the arm may be off."""


@dataclass(frozen=True)
class CameraMonitorOptions:
    """Thresholds from which on frames and markers are not believed.

    Attributes:
        silence: a camera without a new frame for this time is frozen [s] ...
        silent_frames: ... if it is also this many times the usual time between frames [1].
        moved: the camera is frozen if a frame with the hand in view stays the same while some
            muscle moves by this [m].
        turned: the camera is frozen if a frame stays the same while the camera turns by this [rad].
        memory: time over which hidden markers are counted, or longer for a slow camera [s].
        hidden_frames: number of frames without the marker, within `memory`, from which on it is
            hidden, ...
        hidden_share: ... if they are also this share of the frames within `memory` [1].
        still_m: while the map is not trusted, a marker is only missed if its predicted position
            has moved by less than this since it was seen [m], ...
        still_rad: ... and its predicted orientation has turned by less than this [rad].
        margin: a marker is only missed if it is expected this far inside the frame, as a share of
            the frame's height, ...
        whole: ... and at least by this number of its sides, ...
        facing: ... and its normal at most this far from the line of sight [rad].
        mirrored: least angle between the expected and a mirrored pose [rad].
        nearer: factor by which one of the two poses must be nearer to the expected one [1].
        longest: a pose that stays mirrored, or another hand's, for longer is right, and the
            expected one wrong [s].
        follows: share of a predicted movement by which a hand without a marker may have moved
            otherwise, if the map is trusted [1], ...
        follows_untrusted: ... if it is not [1], ...
        follows_m: ... and this distance more [m].
    """

    silence: float = 1.0
    silent_frames: float = 4.0
    moved: float = 0.005
    turned: float = 0.1
    memory: float = 2.0
    hidden_frames: int = 2
    hidden_share: float = 0.15
    still_m: float = 0.05
    still_rad: float = 0.15
    margin: float = 70.0 / 480.0
    whole: float = 0.85
    facing: float = 1.0
    mirrored: float = 0.2
    nearer: float = 0.4
    longest: float = 15.0
    follows: float = 0.3
    follows_untrusted: float = 0.7
    follows_m: float = 0.03


class FrozenCameraMonitor:
    """Finds that no new frame arrives, or that the newest one is an old one.

    Args:
        options: thresholds.
    """

    def __init__(self, options: CameraMonitorOptions) -> None:
        self._options = options
        self.reset()

    def reset(self) -> None:
        """Forget all frames."""
        self._came, self._frame_time = np.inf, -np.inf
        self._between: deque[float] = deque(maxlen=FRAMES)
        self._frame: np.ndarray | None = None
        self._lengths = np.empty(0)
        self._rotation: Floats | None = None
        self._silent = self._same = False

    def is_new(self, time: float, frame_time: float) -> bool:
        """Whether a frame is newer than all before; called in each control step.

        Args:
            time: now [s].
            frame_time: time at which the newest frame was taken [s].
        """
        new = frame_time > self._frame_time
        if new:
            if time > self._came:
                self._between.append(time - self._came)
            self._came, self._frame_time = time, frame_time
        usual = median(self._between) if self._between else 0.0
        longest = max(self._options.silence, self._options.silent_frames * usual)
        self._silent = time - self._came > longest
        return new

    def forget_estimate(self) -> None:
        """Forget the orientation of the camera: that of another map cannot be compared."""
        self._rotation = None

    def is_another(
        self,
        frame: np.ndarray,
        lengths: Floats,
        hand_in_view: bool,
        rotation: Floats | None = None,
    ) -> bool:
        """Whether a new frame differs from the last one.

        If it does not, the camera is frozen if it has turned since that frame was first seen, or
        if the hand is in view and muscles have moved.

        Args:
            frame: (H, W, 3) uint8.
            lengths: of the muscles (m,) [m].
            hand_in_view: whether the frame shows the hand's marker.
            rotation: estimated orientation of the camera (3, 3) when the frame was taken; None if
                unknown.
        """
        options = self._options
        last = self._frame
        if last is None or not _equal(frame, last):
            if last is None or last.shape != frame.shape:
                self._frame = frame.copy()
            else:
                np.copyto(last, frame)  # without new memory, which takes longer than the copy
            self._lengths, self._same = lengths.copy(), False
            self._rotation = rotation
            return True
        if self._rotation is None:
            self._rotation = rotation
        elif rotation is not None:
            self._same |= angle_between(rotation, self._rotation) > options.turned
        moved = float(np.abs(lengths - self._lengths).max())
        self._same |= hand_in_view and moved > options.moved
        return False

    @property
    def frozen(self) -> bool:
        """Whether the camera is frozen."""
        return self._silent or self._same


def _equal(frame: np.ndarray, other: np.ndarray) -> bool:
    """Whether two frames (H, W, 3) are the same; the noise of a camera shows in the first rows."""
    if frame.shape != other.shape:
        return False
    starts = range(0, len(frame), ROWS)
    return all(np.array_equal(frame[k : k + ROWS], other[k : k + ROWS]) for k in starts)


class _Movement(Enum):
    """How a hand has moved: with the arm, otherwise, or too little to show it."""

    OWN = auto()
    OTHER = auto()
    SMALL = auto()


class _Sighted(NamedTuple):
    """Positions (3,) [m] of a hand as seen and predicted, and the pose's covariance (6, 6)."""

    seen: Floats
    predicted: Floats
    covariance: Floats


class HandMonitor:
    """Compares the hand in each frame with its expected pose.

    Args:
        camera: the camera that the frames come from.
        options: thresholds.
    """

    def __init__(self, camera: Camera, options: CameraMonitorOptions) -> None:
        self._camera = camera
        self._options = options
        self.reset()

    def reset(self) -> None:
        """Forget where the hand was."""
        self._frames: deque[tuple[float, bool]] = deque()
        self._doubled = self._image = self._mirrored = self._other = False
        self._mirrored_since = self._other_since = np.inf
        self._seen: Floats | None = None
        self._sighting = np.eye(4)
        self._side_px = self._distance = 0.0
        self._predicted: Floats | None = None
        self._reference: _Sighted | None = None

    def forget_estimate(self) -> None:
        """Forget the predicted pose: that of another map cannot be compared.

        The map changes at rest, so the hand is still where it was in the last frame.
        """
        self._predicted = self._reference = None

    def update(
        self,
        frame_time: float,
        hand: Hand,
        predicted: Floats | None,
        trusted: bool = True,
        around: Callable[[Floats], bool] | None = None,
    ) -> None:
        """Add the result of a new frame.

        Args:
            frame_time: time at which the frame was taken [s].
            hand: what was found.
            predicted: pose of the hand in the camera (4, 4) at the estimate of that time; None if
                unknown.
            trusted: whether the map is trusted.
            around: whether a frame shows the hand at a pose (4, 4), where it has no marker.
        """
        missed = hand.kind if isinstance(hand, HandMissed) else ""
        self._doubled = missed == "doubled"
        self._image = missed == "mirrored"
        hidden = False
        if predicted is not None:
            hidden = self._compare(frame_time, hand, predicted, trusted, around)
        self._frames.append((frame_time, hidden))
        options, frames = self._options, self._frames
        while len(frames) > options.hidden_frames and frame_time - frames[0][0] > options.memory:
            frames.popleft()

    def _compare(
        self,
        frame_time: float,
        hand: Hand,
        predicted: Floats,
        trusted: bool,
        around: Callable[[Floats], bool] | None,
    ) -> bool:
        """Compare the outcome with the expected pose (module docstring); whether it is hidden."""
        expected = predicted
        if self._seen is not None:
            moved = (
                np.eye(4) if self._predicted is None else np.linalg.inv(self._predicted) @ predicted
            )
            self._seen = expected = self._seen @ moved
        self._predicted = predicted
        if isinstance(hand, HandSeen):
            self._add(frame_time, hand, expected, predicted, trusted)
        elif hand.kind == "absent" and self._seen is not None:
            known = trusted or self._is_still(expected)
            return known and self._must_be_in_view(expected, around)
        return False

    def _add(
        self, frame_time: float, hand: HandSeen, expected: Floats, predicted: Floats, trusted: bool
    ) -> None:
        """Compare the pose of a hand with the expected one, and keep it if it is believed."""
        self._mirrored, self._mirrored_since = self._lasting(
            frame_time, self._is_mirrored(hand, expected), self._mirrored_since
        )
        movement = self._movement(hand, predicted, trusted)
        self._other, self._other_since = self._lasting(
            frame_time, movement is _Movement.OTHER, self._other_since
        )
        if self._mirrored or self._other:
            return
        self._seen = self._sighting = hand.pose
        self._side_px = hand.side_px
        self._distance = float(np.linalg.norm(self._seen[:3, 3]))
        if movement is not _Movement.SMALL and hand.covariance is not None:
            self._reference = _Sighted(hand.pose[:3, 3], predicted[:3, 3], hand.covariance)

    def _lasting(self, time: float, wrong: bool, since: float) -> tuple[bool, float]:
        """Whether a pose is wrong, and since when [s]; one that stays so for long is right."""
        since = min(since, time) if wrong else np.inf
        if time - since > self._options.longest:
            return False, np.inf
        return wrong, since

    def found(self, what: FoundBy = "marker") -> Iterator[str]:
        """Kinds of faults that are found now.

        Args:
            what: what is found of the hand.
        """
        hidden = sum(hidden for _, hidden in self._frames)
        most = self._options.hidden_share * len(self._frames)
        found = (
            hidden >= max(self._options.hidden_frames, most),
            self._doubled,
            self._mirrored or self._image,
            self._other,
        )
        yield from (kind for kind, now in zip(KINDS[what], found, strict=True) if now)

    def _movement(self, hand: HandSeen, predicted: Floats, trusted: bool) -> _Movement:
        """How a hand without a marker has moved since it was believed, by the estimate."""
        last, options = self._reference, self._options
        if last is None or hand.covariance is None:
            return _Movement.OWN
        moved, wanted = hand.pose[:3, 3] - last.seen, predicted[:3, 3] - last.predicted
        share = options.follows if trusted else options.follows_untrusted
        variance = float(np.trace((last.covariance + hand.covariance)[:3, :3]))
        most, far = DEVIATIONS * np.sqrt(variance) + options.follows_m, np.linalg.norm(wanted)
        if np.linalg.norm(moved - wanted) > most + share * far:
            return _Movement.OTHER
        return _Movement.OWN if (1.0 - share) * far > most else _Movement.SMALL

    def _is_mirrored(self, hand: HandSeen, expected: Floats) -> bool:
        """Whether the flipped pose of a hand is the one that is expected (4, 4)."""
        options = self._options
        if hand.flipped is None:
            return False
        away = angle_between(hand.pose, expected)
        other = angle_between(hand.flipped, expected)
        if self._mirrored:  # until the pose is clearly the right one
            return away > options.nearer * other
        return away > options.mirrored and other < options.nearer * away

    def _is_still(self, pose: Floats) -> bool:
        """Whether an expected pose (4, 4) is close to where the marker was seen last."""
        moved = float(np.linalg.norm(pose[:3, 3] - self._sighting[:3, 3]))
        turned = angle_between(pose, self._sighting)
        return moved <= self._options.still_m and turned <= self._options.still_rad

    def _must_be_in_view(
        self, pose: Floats, around: Callable[[Floats], bool] | None = None
    ) -> bool:
        """Whether a hand at a pose (4, 4) is well inside the frame and faces the camera."""
        position, normal = pose[:3, 3], pose[:3, 2]
        camera, options = self._camera, self._options
        pixel = camera.project(position)
        if not np.isfinite(pixel).all():
            return False
        side = self._side_px * self._distance / float(np.linalg.norm(position))
        margin = max(options.margin * camera.height, options.whole * side) - 0.5
        inside = (pixel > margin) & (
            pixel < [camera.width - 1 - margin, camera.height - 1 - margin]
        )
        if around is not None:
            return bool(inside.all()) and around(pose)
        facing = np.arccos(np.clip(-normal @ position / np.linalg.norm(position), -1.0, 1.0))
        return bool(inside.all()) and bool(facing < options.facing)
