"""Search for a can among the pixels of its colour: places and distances where its outline may be.

For each of some distances, the painted part that a can would show is laid over the painted pixels
at every place. Its score is the share of painted pixels within it, less that in a margin around it.
A can beside things of the same colour, or behind others, still has a peak of the score.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.can_shape import Can, CanShape, outline_pixels, outline_points

LONGEST_PX = 320
"""The search takes place in an image that is reduced until no side is longer [px]."""
SMALLEST_PX = 16.0
"""Least width of a can's image that is searched for [px]."""
LARGEST = 0.9
"""Largest height of it [heights of the frame]."""
STEP = 1.15
"""Ratio of neighbouring distances [1]."""
MARGIN = 0.2
"""Width of the margin around the painted part [widths of its image]."""
LEAST_SCORE = 0.25
"""Least score of a candidate [1]."""
MOST = 6
"""Largest number of candidates."""
LEAST_PIXELS = 40
"""Fewer painted pixels show no can."""
POINTS = outline_points((12, 6))


class Candidate(NamedTuple):
    """A place where a can may be.

    Attributes:
        can: where it would be.
        score: share of painted pixels within it, less that around it [1].
        centre: of its image (2,) [px].
        width: of its image [px].
    """

    can: Can
    score: float
    centre: Floats
    width: float


def candidates(mask: np.ndarray, camera: Camera, shape: CanShape, up: Floats) -> list[Candidate]:
    """Places where a can may be, best first; they differ in place or distance.

    Args:
        mask: painted pixels (H, W) float32.
        camera: that took the frame.
        shape: of the can.
        up: direction of the can's axis in the camera (3,).
    """
    if cv2.countNonZero(mask) < LEAST_PIXELS:
        return []
    reduction = int(np.ceil(max(camera.width, camera.height) / LONGEST_PX))
    size = (camera.width // reduction, camera.height // reduction)
    small = cv2.resize(mask, size, interpolation=cv2.INTER_AREA)
    rows, columns = np.nonzero(small > 0.5)
    if len(rows) == 0:
        return []
    middle = reduction * np.array([np.median(columns), np.median(rows)])
    high, wide = np.ptp(rows) + 1, np.ptp(columns) + 1
    left, top = max(columns.min() - wide, 0), max(rows.min() - high, 0)
    small = small[top : rows.max() + high + 1, left : columns.max() + wide + 1]
    view = _View(np.ascontiguousarray(small), (int(left), int(top)), reduction)
    found = []
    for depth in _depths(camera, shape):
        can = Can(camera.rays(middle) * depth, up)
        template = _template(camera, shape, can, reduction)
        if template is not None and template.area * LEAST_SCORE <= len(rows):
            found += _peaks(view, template, camera, can)
    found.sort(key=lambda one: -one.score)
    kept: list[Candidate] = []
    for one in found:
        if len(kept) < MOST and not any(_alike(one, other) for other in kept):
            kept.append(one)
    return kept


def _depths(camera: Camera, shape: CanShape) -> Floats:
    """Distances at which cans are searched for [m]."""
    nearest = camera.fy * 2 * shape.half_paint / (LARGEST * camera.height)
    nearest = max(nearest, 2.0 * shape.radius)
    farthest = max(camera.fx * 2 * shape.radius / SMALLEST_PX, nearest)
    count = int(np.ceil(np.log(farthest / nearest) / np.log(STEP))) + 1
    return np.geomspace(nearest, farthest, count)


class _View(NamedTuple):
    """The part of a reduced image with painted pixels, and as much around it.

    Attributes:
        painted: share of painted pixels in each (h, w) [1].
        corner: its first column and row in the reduced image.
        reduction: of the image [1].
    """

    painted: np.ndarray
    corner: tuple[int, int]
    reduction: int


class _Template(NamedTuple):
    """What a can at a distance would show, in the reduced image.

    Attributes:
        kernel: whose correlation with the painted pixels is the score (h, w).
        width: of the can's image [px of the frame].
        area: of the painted part [px of the reduced image].
    """

    kernel: np.ndarray
    width: float
    area: int


def _template(camera: Camera, shape: CanShape, can: Can, reduction: int) -> _Template | None:
    """What a can would show; None if it is not wholly before the camera."""
    pixels, _ = outline_pixels(shape, can, camera, POINTS)
    if not np.isfinite(pixels).all():
        return None
    corners = (pixels - camera.project(can.middle)) / reduction
    width = camera.fx * 2 * shape.radius / float(can.middle[2])
    margin = max(1, round(MARGIN * width / reduction))
    reach = int(np.ceil(np.abs(corners).max())) + margin + 1
    inside = np.zeros((2 * reach + 1, 2 * reach + 1), np.uint8)
    cv2.fillPoly(inside, [np.rint(corners + reach).astype(np.int32)], 1)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * margin + 1, 2 * margin + 1))
    around = cv2.dilate(inside, disc) - inside
    kernel = inside / inside.sum() - around / around.sum()
    return _Template(kernel.astype(np.float32), width, int(inside.sum()))


def _peaks(view: _View, template: _Template, camera: Camera, can: Can) -> list[Candidate]:
    """The best places of a template, half a width apart."""
    score = cv2.filter2D(view.painted, cv2.CV_32F, template.kernel, borderType=cv2.BORDER_CONSTANT)
    near = 2 * max(1, round(0.5 * template.width / view.reduction)) + 1
    highest = cv2.dilate(score, np.ones((near, near), np.uint8))
    rows, columns = np.nonzero((score >= highest) & (score > LEAST_SCORE))
    found = []
    for row, column in zip(rows, columns, strict=True):
        centre = view.reduction * (np.array([column, row]) + view.corner + 0.5) - 0.5
        ray = camera.rays(centre)
        if np.isfinite(ray).all():
            there = can._replace(middle=ray * can.middle[2])
            found.append(Candidate(there, float(score[row, column]), centre, template.width))
    found.sort(key=lambda one: -one.score)
    return found[:MOST]


def _alike(one: Candidate, other: Candidate) -> bool:
    """Whether both would lead to the same can."""
    apart = float(np.linalg.norm(one.centre - other.centre))
    near = apart < 0.4 * max(one.width, other.width)
    return near and max(one.width / other.width, other.width / one.width) < STEP**2.5
