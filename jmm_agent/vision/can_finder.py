"""A can in a frame by its colour and its shape, without a marker on it and without learning.

1. Pixels of the can's hue and saturation are painted (`can_colour`).
2. Where and at which distance they look like a can, there are candidates (`can_search`).
3. The outline of a standing cylinder is fitted to the edges of the paint (`can_fit`).
4. A candidate is a can if most of its outline has an edge in the frame and if it is filled with
   paint. The best one is the can, unless a second one is about as good.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import cv2
import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.can_colour import painted, smoothed
from jmm_agent.vision.can_fit import Fit, Picture, fit_can, upper_end
from jmm_agent.vision.can_search import candidates
from jmm_agent.vision.can_shape import CanKind, CanShape, axes_across
from jmm_agent.vision.marker_detector import MarkerPose
from jmm_agent.vision.marker_input import check_frame

AGREED, ARC, SIDE = 0.75, 0.6, 0.25
"""Least share of a can's outline that has an edge in the frame; of each arc, of each side [1]."""
MISSED = 0.15
"""Largest share of an arc whose edge is elsewhere [1].

The edge of a thing that hides a part of the can may look like a side of it, and the can like a
narrower one that is farther away. Then its arcs do not meet their edges."""
FILLED = 0.5
"""Least share of painted pixels within it [1]."""
SECOND = 0.8
"""A second candidate with this share of the best one's edges could be the can, too [1]."""
A_PART = 0.25
"""Share of the outline that has an edge where a part of a can is seen [1]."""
STANDS = float(np.deg2rad(10.0))
"""Largest tilt of a standing can from the vertical as it is believed to be [rad]."""
SIZE_ERROR = 0.01
"""Standard deviation of a can's size, relative to that of its shape [1]."""
POSITION_ERROR = 0.001
"""Least standard deviation of its place along each axis [m]."""
UNCERTAIN = 0.5
"""A can whose place has a larger standard deviation has no pose [radii]."""
BORDER_PX = 1.0
"""An outline nearer to the border of the frame is cut by it [px]."""


class CanSkip(Enum):
    """Why a frame has no pose of the can."""

    NO_FRAME = "there is no frame"
    DARK = "the frame is black"
    NOT_SEEN = "the can is not in the frame"
    CUT = "the border of the frame cuts the can"
    HIDDEN = "a part of the can is hidden"
    TWICE = "another thing in the frame could be the can"
    UNCERTAIN = "the can's place is too uncertain"


@dataclass(frozen=True)
class CanDetection:
    """The can in one frame.

    Attributes:
        pose_can_in_camera: of the middle of its upper end (4, 4), metres, z along its axis upwards;
            its rotation about the axis is arbitrary. Camera x right, y down, z forward.
        covariance: of the position in the camera's axes (3, 3) [m^2]; None if it is unknown.
    """

    pose_can_in_camera: Floats
    covariance: Floats | None


class _Judged(NamedTuple):
    """A fitted candidate, and how much of it is filled with paint [1]."""

    fit: Fit
    filled: float


class CanFinder:
    """Finds a can that stands upright in frames of a camera.

    Args:
        camera: that takes the frames.
        shape: size and colour of the can; those of Kengoro's can if left out.

    Attributes:
        shape: as given.

    Raises:
        AgentError: there is no camera, or the shape is none.
    """

    def __init__(self, camera: Camera, shape: CanShape | None = None) -> None:
        if not isinstance(camera, Camera):
            raise AgentError(f"A finder of a can needs a Camera, got {type(camera).__name__}.")
        if not isinstance(shape, CanShape | None):
            raise AgentError(f"A finder of a can needs its CanShape, got {type(shape).__name__}.")
        self._camera, self.shape = camera, shape or CanShape()

    def detect(self, frame_rgb: np.ndarray, up: Floats) -> CanDetection | CanSkip:
        """The pose of the can in a frame, or why it has none.

        Args:
            frame_rgb: (H, W, 3) uint8.
            up: direction of the vertical in the camera (3,), known to some degrees.

        Raises:
            AgentError: the frame has a wrong shape or type, or ``up`` is no direction.
        """
        check_frame(frame_rgb, self._camera)
        up = _direction(up)
        if not np.any(frame_rgb):
            return CanSkip.DARK
        colours, noise = smoothed(frame_rgb)
        mask = painted(colours, noise, self.shape)
        picture = Picture(colours, noise, mask, self._camera)
        return self._decide(self._fitted(picture, up), up)

    def _fitted(self, picture: Picture, up: Floats) -> list[_Judged]:
        """Candidates that were fitted, but for those within one that is a can for sure."""
        found: list[_Judged] = []
        for one in candidates(picture.mask, self._camera, self.shape, up):
            if any(_whole(other.fit) and _within(one.centre, other.fit) for other in found):
                continue
            fit = fit_can(picture, self.shape, one.can, up)
            if fit is not None:
                found.append(_Judged(fit, _filled(picture.mask, fit.pixels)))
        return found

    def _decide(self, found: list[_Judged], up: Floats) -> CanDetection | CanSkip:
        """The can among fitted candidates."""
        fits = [one.fit for one in found if one.filled >= FILLED and _stands(one.fit, up)]
        fits.sort(key=lambda fit: -fit.agreed)
        whole = [fit for fit in fits if _whole(fit)]
        if not whole:
            parts = [fit for fit in fits if fit.agreed >= A_PART]
            if any(self._is_cut(fit) for fit in parts):
                return CanSkip.CUT
            return CanSkip.HIDDEN if parts else CanSkip.NOT_SEEN
        best = whole[0]
        if any(_second(best, other) for other in whole[1:]):
            return CanSkip.TWICE
        return self._detection(best) if self._is_certain(best) else CanSkip.UNCERTAIN

    def _is_cut(self, fit: Fit) -> bool:
        """Whether the border of the frame cuts the outline."""
        last = np.array([self._camera.width - 1, self._camera.height - 1]) - BORDER_PX
        return bool(np.any(fit.pixels < BORDER_PX) or np.any(fit.pixels > last))

    def _is_certain(self, fit: Fit) -> bool:
        """Whether the edges determine the place of the can."""
        _, covariance = upper_end(fit, self.shape)
        return float(np.linalg.eigvalsh(covariance)[-1]) < (UNCERTAIN * self.shape.radius) ** 2

    def _detection(self, fit: Fit) -> CanDetection:
        """Pose and covariance; the error of the can's size is one of its distance."""
        position, covariance = upper_end(fit, self.shape)
        covariance = covariance + POSITION_ERROR**2 * np.eye(3)
        covariance += SIZE_ERROR**2 * np.outer(fit.can.middle, fit.can.middle)
        pose = np.eye(4)
        first, second = axes_across(fit.can.axis)
        pose[:3, :3] = np.column_stack([first, second, fit.can.axis])
        pose[:3, 3] = position
        return CanDetection(pose, covariance)


def _whole(fit: Fit) -> bool:
    """Whether most of the outline has edges, and nothing looks as if it were a side of the can."""
    arcs, sides = fit.parts[::2], fit.parts[1::2]
    there = fit.agreed >= AGREED and float(arcs.min()) >= ARC and float(sides.min()) >= SIDE
    return there and float(fit.missed[::2].max()) <= MISSED


def _stands(fit: Fit, up: Floats) -> bool:
    """Whether the can stands upright."""
    return float(np.arccos(np.clip(fit.can.axis @ up, -1.0, 1.0))) <= STANDS


def _second(best: Fit, other: Fit) -> bool:
    """Whether another candidate is about as good as the best one, and elsewhere in the frame."""
    within = _within(best.pixels.mean(axis=0), other) or _within(other.pixels.mean(axis=0), best)
    return not within and other.agreed >= SECOND * best.agreed


def _within(pixel: Floats, fit: Fit) -> bool:
    """Whether a pixel (2,) lies within the outline, or before its hollow side."""
    outline = cv2.convexHull(fit.pixels.astype(np.float32)[:, None])
    return cv2.pointPolygonTest(outline, (float(pixel[0]), float(pixel[1])), False) >= 0.0


def _filled(mask: np.ndarray, pixels: Floats) -> float:
    """Share of painted pixels within an outline (n, 2) [1]."""
    height, width = mask.shape
    low = np.clip(np.floor(pixels.min(axis=0)).astype(int), 0, [width - 1, height - 1])
    high = np.clip(np.ceil(pixels.max(axis=0)).astype(int) + 1, 1, [width, height])
    if np.any(high <= low):
        return 0.0
    within = np.zeros((high - low)[::-1], np.uint8)
    cv2.fillPoly(within, [np.rint(pixels - low).astype(np.int32)], 1)
    part = mask[low[1] : high[1], low[0] : high[0]]
    return float(part[within > 0].mean()) if within.any() else 0.0


def can_of(marker: MarkerPose) -> CanDetection:
    """The can by the marker on its upper end.

    Args:
        marker: on the can.
    """
    known = None if marker.covariance is None else marker.covariance[:3, :3]
    return CanDetection(marker.pose_marker_in_camera, known)


def checked_finder(finder: CanFinder | None, kind: CanKind, camera: str) -> CanFinder | None:
    """The finder, if the options want one.

    Args:
        finder: of the can; None if there is none.
        kind: of the can, by the options.
        camera: name of the camera in the kinematics; empty for a robot without one.

    Raises:
        AgentError: a can that is seen needs a finder, or a finder has no can to find or no camera.
    """
    if finder is not None and not camera:
        raise AgentError("Agent: a finder of the can needs a camera, but the options name none.")
    if (finder is not None) != (kind == "seen") and camera:
        which = "needs a CanFinder" if kind == "seen" else "needs no CanFinder"
        raise AgentError(f"Agent: AgentOptions(can={kind!r}) {which}.")
    return finder


def _direction(up: Floats) -> Floats:
    """The vertical as a unit vector (3,)."""
    array = np.asarray(up, dtype=float)
    length = float(np.linalg.norm(array)) if array.shape == (3,) else np.nan
    if not (np.isfinite(length) and length > 0.0):
        raise AgentError(f"The vertical must be a direction of shape (3,), but is {up!r}.")
    return np.asarray(array / length)
