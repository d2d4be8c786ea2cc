"""Sub-pixel corners of a dark square on a light ground: intersections of lines along its edges."""

import numpy as np

ALONG = np.linspace(0.1, 0.9, 48)
"""Positions of the profiles, as shares of an edge; near its ends the next edge blurs them."""
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
MIN_PROFILES = 12
"""Least number of profiles that count on each edge."""
NEXT, OPPOSITE, BEFORE = [1, 2, 3, 0], [2, 3, 0, 1], [3, 0, 1, 2]
"""Other corners, or edges, of each one."""


def refine_corners(gray: np.ndarray, corners: np.ndarray, cells: int) -> np.ndarray | None:
    """Refine the corners of a dark square with dark outer cells and a light surround.

    A row of profiles crosses each edge. The middle of a profile's step (the mean of its positions,
    weighted with its gradient) does not depend on a symmetric blur. A robust line is fitted through
    the steps of each edge; the corners are the intersections of the lines.

    Args:
        gray: (H, W) uint8.
        corners: (4, 2) rough corners [px], clockwise in the image, each within a third of a cell.
        cells: width of the square in cells; a light margin of half a cell is needed.

    Returns:
        Corners (4, 2) [px]; None if an edge has too few clean profiles, because it is hidden or out
        of the frame, or if its line leads away from the rough corners.
    """
    quad = np.asarray(corners, dtype=float)
    for reach_px in REACHES_PX:
        edge = quad[NEXT] - quad
        length = np.hypot(edge[:, 0], edge[:, 1])
        along = edge / length[:, None]
        outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
        depth = ((2 * quad - quad[OPPOSITE] - quad[BEFORE]) * outward).sum(axis=1) / 2
        reach = np.minimum(REACH_CELLS * depth / cells, reach_px)

        foot = quad[:, None] + ALONG[:, None] * edge[:, None]
        shift, clean = _steps(gray, foot, outward, reach)
        if clean.sum(axis=1).min() < MIN_PROFILES:
            return None
        level, slope, kept = _fit((ALONG - 0.5) * length[:, None], shift, clean)
        if kept.min() < MIN_PROFILES:
            return None
        refined = _meet(
            quad + edge / 2 + level[:, None] * outward, outward - slope[:, None] * along
        )
        if not np.abs(refined - quad).max() < length.max() / cells:
            return None
        quad = refined
    return quad


def _steps(
    gray: np.ndarray, foot: np.ndarray, outward: np.ndarray, reach: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Distance of the steps outward of `foot` (4, n, 2), (4, n) [px]; which are clean (4, n)."""
    offset = reach[:, None] * ACROSS
    x = foot[:, :, None, 0] + (offset * outward[:, :1])[:, None]
    y = foot[:, :, None, 1] + (offset * outward[:, 1:])[:, None]
    value, inside = _bilinear(gray, x, y)
    step = value[..., -1] - value[..., 0]
    typical = np.sort(step, axis=1)[:, 3 * len(ALONG) // 4]
    clean = inside & (step > CONTRAST * typical[:, None]) & (step > 0)
    shift = reach[:, None] * (np.diff(value) @ MIDDLES) / np.where(clean, step, 1.0)
    return shift, clean


def _bilinear(gray: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Grey values (4, n, k) at x, y (4, n, k) [px]; which profiles are in the frame (4, n)."""
    height, width = gray.shape
    left, top = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    inside = ((left >= 0) & (top >= 0) & (left < width - 1) & (top < height - 1)).all(axis=-1)
    right_part, low_part = x - left, y - top
    flat = gray.ravel()
    corner = np.where(inside[..., None], top * width + left, 0)
    upper_left, lower_left = flat[corner].astype(float), flat[corner + width].astype(float)
    upper = upper_left + right_part * (flat[corner + 1] - upper_left)
    lower = lower_left + right_part * (flat[corner + width + 1] - lower_left)
    return upper + low_part * (lower - upper), inside


def _fit(
    position: np.ndarray, shift: np.ndarray, clean: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Robust lines shift = level + slope * position of rows (4, n), and how many each keeps."""
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
    return level, slope, (weight > 1e-6).sum(axis=1)


def _meet(point: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Intersections (4, 2) of each edge and the one before; a point and a normal (4, 2) of each."""
    level = (point * normal).sum(axis=1)
    before, level_before = normal[BEFORE], level[BEFORE]
    area = before[:, 0] * normal[:, 1] - before[:, 1] * normal[:, 0]
    x = level_before * normal[:, 1] - level * before[:, 1]
    y = level * before[:, 0] - level_before * normal[:, 0]
    return np.stack([x, y], axis=1) / area[:, None]
