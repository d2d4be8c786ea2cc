"""Sub-pixel corners of a dark square on a light ground, where lines along its edges meet."""

import numpy as np

ALONG = np.linspace(
    0.1, 0.9, 48
)  # profiles, as parts of an edge; near its ends the neighbouring edge blurs them
ACROSS = np.linspace(
    -1.0, 1.0, 15
)  # samples of a profile, in reaches, from the dark side to the light one
MIDDLES = (ACROSS[1:] + ACROSS[:-1]) / 2
REACH_CELLS = 0.35  # reach of a profile to either side, at most ...
REACHES_PX = (
    np.inf,
    3.0,
    3.0,
)  # ... this, pass by pass; each pass follows the lines of the one before
CONTRAST = 0.4  # a profile counts if its step is at least this part of the edge's upper quartile
CUTS_PX = (3.0, 1.0, 0.4, 0.4)  # where Tukey's biweight reaches zero, fit by fit
MIN_PROFILES = 12  # per edge
NEXT, OPPOSITE, BEFORE = (
    [1, 2, 3, 0],
    [2, 3, 0, 1],
    [3, 0, 1, 2],
)  # corners, or edges, seen from each one


def refine_corners(gray: np.ndarray, corners: np.ndarray, cells: int) -> np.ndarray | None:
    """Corners of a dark square, `cells` cells wide, with dark outer cells and a light surround.

    Across each edge a row of profiles is taken; the middle of a profile's step (the mean of its
    positions, weighted with its gradient) does not depend on a symmetric blur. Robust lines go
    through the steps of each edge, and the corners are where the lines meet.

    Args:
        gray: (H, W) uint8.
        corners: (4, 2) rough corners [px], clockwise in the image, each within a third of a cell.
        cells: width of the square in cells; a light margin of half a cell is needed.

    Returns:
        (4, 2) corners [px], or None where an edge has too few clean profiles (hidden, or out of
        the frame) or its line leads away from the rough corners.
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
    """How far outward of `foot` (4, n, 2) the steps lie (4, n) [px]; which are clean (4, n)."""
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
    """Where each edge meets the edge before it (4, 2), from a point and a normal (4, 2) of each."""
    level = (point * normal).sum(axis=1)
    before, level_before = normal[BEFORE], level[BEFORE]
    area = before[:, 0] * normal[:, 1] - before[:, 1] * normal[:, 0]
    x = level_before * normal[:, 1] - level * before[:, 1]
    y = level * before[:, 0] - level_before * normal[:, 0]
    return np.stack([x, y], axis=1) / area[:, None]
