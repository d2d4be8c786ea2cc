"""Sub-pixel corners of a dark square on a light ground: intersections of lines along its edges."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jmm_agent.types import Bools, Floats
from jmm_agent.vision.marker_view import MarkerView

ALONG = (0.1, 0.9)
"""First and last profile, as shares of an edge; near its ends the next edge blurs them."""
PROFILES, PROFILES_PER_PX = 48, 0.4
"""Least number of profiles on an edge, and number per pixel of a longer one."""
ACROSS = np.linspace(-1.0, 1.0, 15)
"""Samples of a profile, in reaches, from the dark side to the light one."""
MIDDLES = (ACROSS[1:] + ACROSS[:-1]) / 2
REACH_CELLS = 0.35
"""Largest reach of a profile to either side, in cells."""
REACHES_PX = (np.inf, 3.0, 3.0)
"""Largest reach in each pass [px]; each pass follows the lines of the one before."""
CONTRAST = 0.4
"""A profile counts if its step is at least this share of the upper quartile of the edge."""
CUTS_PX = (3.0, 1.0, 0.4, 0.4)
"""Distance at which Tukey's biweight reaches zero, in each fit of the lines [px]."""
MIN_SHARE = 0.25
"""Least share of the profiles that count on each edge."""
SHARP_WIDTH = 0.45
"""Largest width of a step in reaches; that of a constant slope, without an end, is 0.58."""
SHARP_SPREAD_PX = 0.09
"""Largest RMS distance of steps from their line [px]."""
ENDS = 5.7
"""Variance of a line's level at an end of an edge, in variances of its mean."""
NEXT, OPPOSITE, BEFORE = [1, 2, 3, 0], [2, 3, 0, 1], [3, 0, 1, 2]
"""Other corners, or edges, of each one."""


class EdgeCorners(NamedTuple):
    """Corners from lines along the edges.

    Attributes:
        points: (4, 2) in the view [px].
        deviation_px: standard deviation of a coordinate [px].
        sharp: whether the frame is sharp and clean enough for lines: the profiles reach beyond the
            blur, and their steps lie on the lines.
    """

    points: Floats
    deviation_px: float
    sharp: bool


def refine_corners(
    gray: np.ndarray, corners: Floats, cells: int, view: MarkerView
) -> EdgeCorners | None:
    """Refine the corners of a dark square with dark outer cells and a light surround.

    A row of profiles crosses each edge. The middle of a profile's step (the mean of its positions,
    weighted with its gradient) does not depend on a symmetric blur. A robust line is fitted through
    the steps of each edge; the corners are the intersections of the lines.

    Args:
        gray: (H, W) uint8.
        corners: (4, 2) rough corners in the view [px], clockwise, each within a third of a cell.
        cells: width of the square in cells; a light margin of half a cell is needed.
        view: in which the edges are straight.

    Returns:
        The corners in the view; None if an edge has too few clean profiles, because it is hidden or
        out of the frame, or if its line leads away from the rough corners.
    """
    quad = np.asarray(corners, dtype=float)
    largest = np.linalg.norm(quad[NEXT] - quad, axis=1).max()
    positions = np.linspace(*ALONG, max(PROFILES, int(PROFILES_PER_PX * largest)))
    least = MIN_SHARE * len(positions)
    deviation, sharp = 0.0, False
    for reach_px in REACHES_PX:
        edge = quad[NEXT] - quad
        length = np.hypot(edge[:, 0], edge[:, 1])
        along = edge / length[:, None]
        outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
        depth = ((2 * quad - quad[OPPOSITE] - quad[BEFORE]) * outward).sum(axis=1) / 2
        reach = np.minimum(REACH_CELLS * depth / cells, reach_px)

        foot = quad[:, None] + positions[:, None] * edge[:, None]
        shift, clean, width = _steps(gray, view, foot, outward, reach)
        if clean.sum(axis=1).min() < least:
            return None
        level, slope, kept, spread = _fit((positions - 0.5) * length[:, None], shift, clean)
        if kept.min() < least:
            return None
        refined = _meet(
            quad + edge / 2 + level[:, None] * outward, outward - slope[:, None] * along
        )
        if not np.abs(refined - quad).max() < length.max() / cells:
            return None
        quad = refined
        sharp = bool(width.max() < SHARP_WIDTH and spread.max() < SHARP_SPREAD_PX)
        free = np.minimum(kept, (ALONG[1] - ALONG[0]) * length)
        deviation = float(np.sqrt(np.mean(ENDS * spread**2 / free)))
    return EdgeCorners(quad, deviation, sharp)


def _steps(
    gray: np.ndarray, view: MarkerView, foot: Floats, outward: Floats, reach: Floats
) -> tuple[Floats, Bools, Floats]:
    """Steps across each edge.

    Returns:
        Distance of the steps outward of ``foot`` (4, n) [px]; which are clean (4, n); and the
        width (standard deviation) of each edge's mean step, in reaches (4,).
    """
    offset = reach[:, None] * ACROSS
    x = foot[:, :, None, 0] + (offset * outward[:, :1])[:, None]
    y = foot[:, :, None, 1] + (offset * outward[:, 1:])[:, None]
    if not view.straight:
        x, y = np.moveaxis(view.frame_px(np.stack([x, y], axis=-1)), -1, 0)
    value, inside = _bilinear(gray, x, y)
    step = value[..., -1] - value[..., 0]
    typical = np.sort(step, axis=1)[:, 3 * step.shape[1] // 4]
    clean = inside & (step > CONTRAST * typical[:, None]) & (step > 0)
    slope = np.diff(value)
    shift = reach[:, None] * (slope @ MIDDLES) / np.where(clean, step, 1.0)
    share = (slope * clean[..., None]).sum(axis=1)
    share = share / np.maximum(share.sum(axis=1, keepdims=True), 1e-9)
    variance = share @ MIDDLES**2 - (share @ MIDDLES) ** 2
    return shift, clean, np.sqrt(np.maximum(variance, 0.0))


def _bilinear(gray: np.ndarray, x: Floats, y: Floats) -> tuple[Floats, Bools]:
    """Grey values (4, n, k) at x, y (4, n, k) [px]; which profiles are in the frame (4, n)."""
    height, width = gray.shape
    x, y = np.nan_to_num(x, nan=-9.0), np.nan_to_num(y, nan=-9.0)
    left, top = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    inside = ((left >= 0) & (top >= 0) & (left < width - 1) & (top < height - 1)).all(axis=-1)
    right_part, low_part = x - left, y - top
    flat = gray.ravel()
    corner = np.where(inside[..., None], top * width + left, 0)
    upper_left, lower_left = flat[corner].astype(float), flat[corner + width].astype(float)
    upper = upper_left + right_part * (flat[corner + 1] - upper_left)
    lower = lower_left + right_part * (flat[corner + width + 1] - lower_left)
    return upper + low_part * (lower - upper), inside


def _fit(position: Floats, shift: Floats, clean: Bools) -> tuple[Floats, Floats, Floats, Floats]:
    """Robust lines shift = level + slope * position of rows (4, n).

    Returns:
        Level [px] and slope of each line, the number of profiles that it keeps, and their RMS
        distance from it [px].
    """
    weight = clean.astype(float)
    for cut in CUTS_PX:
        total = weight.sum(axis=1)
        mean_position = (weight * position).sum(axis=1) / total
        mean_shift = (weight * shift).sum(axis=1) / total
        centred = position - mean_position[:, None]
        weighted = weight * centred
        slope = (weighted * shift).sum(axis=1) / (weighted * centred).sum(axis=1)
        level = mean_shift - slope * mean_position
        residual = shift - level[:, None] - slope[:, None] * position
        weight = clean * np.maximum(1 - (residual / cut) ** 2, 1e-9) ** 2
    spread = np.sqrt((weight * residual**2).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-9))
    return level, slope, (weight > 1e-6).sum(axis=1), spread


def _meet(point: Floats, normal: Floats) -> Floats:
    """Intersections (4, 2) of each edge and the one before; a point and a normal (4, 2) of each."""
    level = (point * normal).sum(axis=1)
    before, level_before = normal[BEFORE], level[BEFORE]
    area = before[:, 0] * normal[:, 1] - before[:, 1] * normal[:, 0]
    x = level_before * normal[:, 1] - level * before[:, 1]
    y = level * before[:, 0] - level_before * normal[:, 0]
    return np.stack([x, y], axis=1) / area[:, None]
