"""Fit of a can's outline to the edges of its paint in a frame.

Along the normal of each point of the predicted outline the frame is sampled. Inside there is paint,
outside something else; the edge lies where the one gives way to the other. Gauss-Newton steps move
the can such that its outline meets the edges, with weights that fall with the distance (Cauchy), so
that edges of what hides a part of the can count little. First the edges are those of the painted
pixels, from farther away; then those of the colours, to a fraction of a pixel:

    edge = end - sum_t share(t) dt,

where share is that of the outer colour, see `_contrast`.

The unknowns are the can's middle (3) and the tilt of its axis (2), of which the direction of the
vertical is known roughly.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.can_shape import (
    Can,
    CanShape,
    OutlinePoints,
    axes_across,
    outline_pixels,
    outline_points,
    tilted,
)

TILT = np.deg2rad(3.0)
"""Standard deviation of the direction in which the vertical is believed to be [rad]."""
SPACING_PX = 2.0
"""Distance of neighbouring points of the outline [px]."""
FEWEST, MOST = 8, 60
"""Least and largest number of points of an arc or a side."""
ENDS = 0.15
"""Share of each part at both ends that has no points, because corners have no clear edge [1]."""
FAR_STEPS, NEAR_STEPS = 8, 5
"""Steps to the edges of painted pixels, and to those of the colours."""
FAR, LEAST_FAR_PX = 0.2, 5.0
"""How far from the outline edges of painted pixels are searched [widths of the image], at least."""
NEAR_PX = 3.0
"""The same for edges of colours [px]."""
SAMPLE_PX = 0.5
"""Distance of samples along a normal [px]."""
AGREES_PX = 0.7
"""An edge within this of the outline agrees with it [px]."""
EDGE_PX = 0.35
"""Least standard deviation of an edge [px]; pixels have a size."""
CORRELATED = 4.0
"""So many neighbouring edges count as one: their errors are alike [1]."""
CONTRAST = 6.0
"""Least difference of the colours inside and outside [standard deviations of the noise]."""
LEAST_CONTRAST = 6.0
"""The same [grey levels]."""
STEP = 1e-6
"""Step of numerical derivatives [m, rad]."""


class Picture(NamedTuple):
    """A frame in which a can is searched.

    Attributes:
        colours: smoothed (H, W, 3) float32 [grey levels].
        noise: of the smoothed frame [grey levels].
        mask: painted pixels (H, W) float32.
        camera: that took it.
    """

    colours: np.ndarray
    noise: float
    mask: np.ndarray
    camera: Camera


class Fit(NamedTuple):
    """A can that was fitted to edges.

    Attributes:
        can: where it is.
        covariance: of its middle [m] and of its tilt about `axes_across` of its axis [rad] (5, 5).
        agreed: share of the outline's points with an edge there [1].
        parts: the same for the upper arc, one side, the lower arc and the other side (4,).
        missed: share of the points of these parts whose edge is elsewhere (4,) [1].
        pixels: of the outline (n, 2).
    """

    can: Can
    covariance: Floats
    agreed: float
    parts: Floats
    missed: Floats
    pixels: Floats


def fit_can(picture: Picture, shape: CanShape, start: Can, up: Floats) -> Fit | None:
    """The can near a place; None if its outline leaves the view of the camera meanwhile.

    Args:
        picture: in which it is.
        shape: of the can.
        start: where the fit begins.
        up: direction of the vertical in the camera (3,).
    """
    fit = _Fitting(picture, shape, up, _points(picture.camera, shape, start))
    values = np.concatenate([start.middle, np.zeros(2)])
    width = picture.camera.fx * 2 * shape.radius / float(start.middle[2])
    for step in range(FAR_STEPS + NEAR_STEPS):
        near = step >= FAR_STEPS
        moved = fit.step(values, None if near else max(FAR * width, LEAST_FAR_PX))
        if moved is None:
            return None
        values = moved
    return fit.result(values)


def _points(camera: Camera, shape: CanShape, can: Can) -> OutlinePoints:
    """Points of the outline, as many as its parts are long."""
    pixels, _ = outline_pixels(shape, can, camera, outline_points((8, 8)))
    lengths = [np.hypot(*np.diff(part, axis=0).T).sum() for part in pixels.reshape(4, 8, 2)]
    numbers = np.nan_to_num(np.array(lengths)) * 8 / 7 / SPACING_PX
    arcs, sides = np.clip([max(numbers[::2]), max(numbers[1::2])], FEWEST, MOST).astype(int)
    return outline_points((int(arcs), int(sides)), ENDS)


class _Fitting:
    """The fit of one can in a picture."""

    def __init__(
        self, picture: Picture, shape: CanShape, up: Floats, points: OutlinePoints
    ) -> None:
        self._picture, self._shape, self._up, self._points = picture, shape, up, points

    def step(self, values: Floats, far: float | None) -> Floats | None:
        """Middle and tilt (5,) after a step to edges; ``far`` [px] for those of painted pixels."""
        found = self._linearised(values, far)
        if found is None:
            return None
        offsets, jacobian, usable = found
        scale = _scale(offsets[usable], 2.0 if far is not None else 0.7)
        weights = usable / (1.0 + (np.where(usable, offsets, 0.0) / scale) ** 2)
        precision = np.zeros(5)
        precision[3:] = 1 / TILT**2
        variance = max(scale, EDGE_PX) ** 2 * CORRELATED
        matrix = (jacobian.T * weights) @ jacobian / variance + np.diag(precision)
        gradient = (jacobian.T * weights) @ np.where(usable, offsets, 0.0) / variance
        matrix[:3, :3] += 1e-3 / values[2] ** 2 * np.eye(3)
        step = np.linalg.solve(matrix, gradient - precision * values)
        reach = 0.15 * values[2]
        step *= min(1.0, reach / max(float(np.linalg.norm(step[:3])), 1e-12))
        moved = values + step
        moved[3:] = np.clip(moved[3:], -3 * TILT, 3 * TILT)
        return moved if moved[2] > self._shape.radius else None

    def result(self, values: Floats) -> Fit | None:
        """What the fit has led to."""
        found = self._linearised(values, None)
        if found is None:
            return None
        offsets, jacobian, usable = found
        agrees = usable & (np.abs(np.where(usable, offsets, 0.0)) <= AGREES_PX)
        spread = max(EDGE_PX, float(np.sqrt(np.mean(offsets[agrees] ** 2))) if agrees.any() else 0)
        rows = jacobian[agrees]
        information = rows.T @ rows / (spread**2 * CORRELATED)
        information += np.diag([1e-2, 1e-2, 1e-2, 1 / TILT**2, 1 / TILT**2])
        own = [self._points.part == part for part in range(4)]
        parts = np.array([np.mean(agrees[part]) for part in own])
        missed = np.array([np.mean((usable & ~agrees)[part]) for part in own])
        can = self._can(values)
        pixels, _ = outline_pixels(self._shape, can, self._picture.camera, self._points)
        covariance = np.asarray(np.linalg.inv(information), dtype=float)
        return Fit(can, covariance, float(np.mean(agrees)), parts, missed, pixels)

    def _can(self, values: Floats) -> Can:
        return Can(values[:3], tilted(self._up, values[3:]))

    def _linearised(
        self, values: Floats, far: float | None
    ) -> tuple[Floats, Floats, np.ndarray] | None:
        """Offsets of edges (n,) [px], their derivatives (n, 5), and which edges there are (n,)."""
        camera = self._picture.camera
        pixels, normals = outline_pixels(self._shape, self._can(values), camera, self._points)
        if not np.isfinite(pixels).all():
            return None
        if far is not None:
            offsets = self._painted_edges(pixels, normals, far)
        else:
            offsets = self._colour_edges(pixels, normals)
        jacobian = np.empty((len(pixels), 5))
        for column in range(5):
            changed = values.copy()
            changed[column] += STEP
            moved, _ = outline_pixels(self._shape, self._can(changed), camera, self._points)
            jacobian[:, column] = ((moved - pixels) * normals).sum(axis=1) / STEP
        return offsets, jacobian, np.isfinite(offsets)

    def _painted_edges(self, pixels: Floats, normals: Floats, far: float) -> Floats:
        """Offsets (n,) [px] of the nearest ends of paint outwards; NaN where there is none."""
        t = np.arange(-far, far + SAMPLE_PX, SAMPLE_PX)
        share = _sampled(self._picture.mask, pixels, normals, t)
        inside = self._in_frame(pixels, 1.0)
        falls = (share[:, :-1] >= 0.5) & (share[:, 1:] < 0.5)
        between = t[:-1] + 0.5 * SAMPLE_PX
        distance = np.where(falls, np.abs(between), np.inf)
        nearest = distance.argmin(axis=1)
        return np.where(falls.any(axis=1) & inside, between[nearest], np.nan)

    def _colour_edges(self, pixels: Floats, normals: Floats) -> Floats:
        """Offsets (n,) [px] of edges by the colours on both sides; NaN where there is none."""
        picture, reach = self._picture, NEAR_PX
        t = np.arange(-reach - 1.0, reach + 1.0 + SAMPLE_PX / 2, SAMPLE_PX)
        colours = _sampled(picture.colours, pixels, normals, t)
        inside, outside = t <= -reach, t >= reach
        inner, outer = colours[:, inside].mean(axis=1), colours[:, outside].mean(axis=1)
        least = max(CONTRAST * picture.noise, LEAST_CONTRAST)
        contrast, offset, clear = _contrast(inner, outer, least)
        between = ~inside & ~outside
        part = (colours[:, between] * contrast[:, None]).sum(axis=2) - offset[:, None]
        offsets = reach - SAMPLE_PX / 2 - np.clip(part, 0.0, 1.0).sum(axis=1) * SAMPLE_PX
        paint = _sampled(picture.mask, pixels, normals, t)
        usable = clear & (paint[:, inside].mean(axis=1) > 0.5)
        usable &= (paint[:, outside].mean(axis=1) < 0.5) & self._in_frame(pixels, reach + 1.0)
        return np.where(usable, offsets, np.nan)

    def _in_frame(self, pixels: Floats, reach: float) -> np.ndarray:
        """Which pixels (n,) are farther than that from the border [px]."""
        camera = self._picture.camera
        last = np.array([camera.width - 1, camera.height - 1])
        return np.asarray(((pixels >= reach) & (pixels <= last - reach)).all(axis=1))


def _scale(offsets: Floats, least: float) -> float:
    """Offset [px] at which an edge has half the weight: the median, or at least ``least``."""
    return max(least, float(np.median(np.abs(offsets)))) if len(offsets) else least


def _contrast(inner: Floats, outer: Floats, least: float) -> tuple[Floats, Floats, np.ndarray]:
    """Weights (n, 3) and offset (n,) that make 0 of the inner colours and 1 of the outer ones.

    Paint in light and shade has colours on a line through black. Weights across this line make 0
    of all of them, unless the outer colour lies on it, too.

    Args:
        inner: colours of the paint (n, 3).
        outer: colours beside it (n, 3).
        least: difference of colours that is clear.

    Returns:
        Weights, offset, and which differences are clear.
    """
    line = inner / np.maximum(np.linalg.norm(inner, axis=1, keepdims=True), 1e-9)
    across = outer - (outer * line).sum(axis=1, keepdims=True) * line
    by_light = np.linalg.norm(across, axis=1) <= least
    weights = np.where(by_light[:, None], outer - inner, across)
    square = np.maximum((weights**2).sum(axis=1), 1e-9)
    weights = weights / square[:, None]
    offset = np.where(by_light, (weights * inner).sum(axis=1), 0.0)
    return weights, offset, square > least**2


def _sampled(image: np.ndarray, pixels: Floats, normals: Floats, t: Floats) -> Floats:
    """Values of an image (H, W[, 3]) at distances t (k,) along normals (n, k[, 3]); 0 outside."""
    at = (pixels[:, None] + t[None, :, None] * normals[:, None]).astype(np.float32)
    x, y = at[..., 0], at[..., 1]
    found = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    return np.asarray(found, dtype=float)


def upper_end(fit: Fit, shape: CanShape) -> tuple[Floats, Floats]:
    """Middle of a can's upper end (3,) [m], and its covariance (3, 3) [m^2].

    Args:
        fit: of the can.
        shape: of the can.
    """
    half = shape.height / 2
    first, second = axes_across(fit.can.axis)
    rows = np.hstack([np.eye(3), half * first[:, None], half * second[:, None]])
    return fit.can.middle + half * fit.can.axis, rows @ fit.covariance @ rows.T
