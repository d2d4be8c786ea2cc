"""Corners of a marker from a fit of its whole pattern to the grey values of a frame.

All edges of all cells carry information, and neighbouring edges may overlap, so the fit also holds
for small, blurred, noisy and partly hidden markers. A pixel that lies at (u, v), in cells, is

    black(u, v) + contrast(u, v) a(u)' P b(v),    a_i = Phi((u - i) / s) - Phi((u - i - 1) / s),

with the pattern P (0 or 1), black level and contrast linear in u and v, and a normal blur whose
width s across an edge follows from its covariance in the view. Gauss-Newton steps (Levenberg's
damping, Tukey's weights) fit the corners, the blur, and the levels.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from jmm_agent.types import Floats
from jmm_agent.vision.marker_view import MarkerView

MARGIN = 0.6
"""Width of the light surround that is fitted [cells]."""
MOST_PIXELS = 4000
"""Number of pixels from which on every n-th one is fitted."""
FEW_PIXELS, LEAST_PIXELS = 700, 50
"""Number of these that the fit begins with; least number."""
STEPS, LAST_STEPS = 25, 3
"""Most steps with few pixels, and then with all."""
MOST_DAMPING = 1e3
"""Damping at which the fit ends."""
TUKEY, LEAST_NOISE = 4.7, 0.5
"""Residual of weight zero, in standard deviations, which are at least this [grey levels]."""
PIXEL_VARIANCE = 1 / 12
"""Variance of the position within a pixel [px^2]."""
START_BLUR, LEAST_BLUR_PX = 0.12, 0.6
"""Standard deviation of the blur at the start, as a share of a cell, and at least [px]."""
MOVED_PX, ASTRAY_CELLS = 0.003, 1.0
"""The fit ends when no corner moves by more pixels, and fails when one moves by more cells."""
LEAST_CONTRAST, LEAST_SHARE = 3.0, 0.6
"""Least contrast, in standard deviations of the residual; least share of pixels explained."""


class PatternFit(NamedTuple):
    """Result of a fit.

    Attributes:
        points: corners in the view (4, 2) [px].
        covariance: of their coordinates (8, 8) [px^2].
        blur_px: standard deviation of the blur along its longer axis [px].
        contrast: between white and black, in standard deviations of the residual.
        share: of the pixels that the pattern explains.
    """

    points: Floats
    covariance: Floats
    blur_px: float
    contrast: float
    share: float


def fit_pattern(
    gray: np.ndarray, corners: Floats, pattern: Floats, view: MarkerView
) -> PatternFit | None:
    """Fit the corners of a marker to a frame.

    Args:
        gray: (H, W) uint8.
        corners: rough corners in the view (4, 2) [px], from the printed upper left one, clockwise
            as printed, each within half a cell.
        pattern: the marker's cells with its black border (n, n): 0 black, 1 white.
        view: in which the edges are straight.

    Returns:
        The corners; None if the frame does not show the pattern there.
    """
    start = np.asarray(corners, dtype=float)
    pixels = _pixels(gray, start, len(pattern), view)
    if pixels is None:
        return None
    points, values = pixels
    square = np.pad(pattern, 1, constant_values=1.0)
    cell = np.linalg.norm(np.roll(start, 1, axis=0) - start, axis=1).min() / len(pattern)
    blur = max(START_BLUR * cell, LEAST_BLUR_PX) ** 2
    x = np.concatenate([start.ravel(), [blur, 0.0, blur], np.zeros(6)])
    few = slice(None, None, -(-len(values) // FEW_PIXELS))
    problem = _Problem(points[few], values[few], square)
    x[11:] = problem.levels(x)
    reach = ASTRAY_CELLS * cell
    for part, steps in ((problem, STEPS), (_Problem(points, values, square), LAST_STEPS)):
        x = _descend(part, x, steps)
        if not np.abs(x[:8] - start.ravel()).max() < reach:
            return None
    return _result(part, x)


def _descend(problem: _Problem, x: Floats, steps: int) -> Floats:
    """Parameters (17,) after a number of steps."""
    damping = 1e-3
    residual, jacobian = problem.linearised(x)
    scale = _scale(residual)
    for _ in range(steps):
        weight = _weight(residual, scale)
        normal = jacobian.T @ (weight[:, None] * jacobian)
        gradient = jacobian.T @ (weight * residual)
        ridge = damping * np.diag(normal) + 1e-9 * normal.trace()
        there = _valid(x - np.linalg.solve(normal + np.diag(ridge), gradient))
        new_residual, new_jacobian = problem.linearised(there)
        if not _cost(new_residual, scale) <= _cost(residual, scale):
            damping *= 10.0
            if damping > MOST_DAMPING:
                break
            continue
        moved = np.abs(there[:8] - x[:8]).max()
        x, residual, jacobian, damping = there, new_residual, new_jacobian, max(damping / 5, 1e-6)
        scale = _scale(residual)
        if moved < MOVED_PX:
            break
    return x


def _result(problem: _Problem, x: Floats) -> PatternFit | None:
    """Result at parameters (17,); None if the pattern is not there."""
    residual, jacobian = problem.linearised(x)
    scale = _scale(residual)
    weight = _weight(residual, scale)
    normal = jacobian.T @ (weight[:, None] * jacobian)
    contrast, share = x[14] / scale, float((weight > 0.1).mean())
    if not (contrast > LEAST_CONTRAST and share > LEAST_SHARE):
        return None
    covariance = scale**2 * np.asarray(np.linalg.pinv(normal), dtype=float)[:8, :8]
    blur = np.linalg.eigvalsh([[x[8], x[9]], [x[9], x[10]]])[-1]
    points, deviation = x[:8].reshape(4, 2), float(np.sqrt(blur))
    return PatternFit(points, np.asarray(covariance), deviation, contrast, share)


def _pixels(
    gray: np.ndarray, corners: Floats, cells: int, view: MarkerView
) -> tuple[Floats, Floats] | None:
    """Pixels of the marker in the view (N, 2) [px] and their grey values (N,)."""
    forward = _from_cells(corners, cells)
    rim = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (cells / 2 + MARGIN) + cells / 2
    frame = view.frame_px(_mapped(forward, rim))
    if not np.isfinite(frame).all():
        return None
    size = np.array(gray.shape[::-1])
    low = np.clip(np.floor(frame.min(axis=0)), 0, size).astype(int)
    high = np.clip(np.ceil(frame.max(axis=0)) + 1, 0, size).astype(int)
    y, x = np.mgrid[low[1] : high[1], low[0] : high[0]]
    # Neighbours in a row or a column are kept equally often.
    stride = 1 + int(np.ptp(frame, axis=0).prod() / (2 * MOST_PIXELS))
    kept = ((3 * x + 5 * y) % stride == 0) if stride > 1 else np.ones(x.shape, dtype=bool)
    flat = np.column_stack([x[kept], y[kept]])
    points = view.view_px(flat.astype(float))
    with np.errstate(invalid="ignore"):
        uv = _mapped(np.asarray(np.linalg.inv(forward), dtype=float), points)
        inside = (np.abs(uv - cells / 2) < cells / 2 + MARGIN).all(axis=1)
    if inside.sum() < LEAST_PIXELS:
        return None
    flat, points = flat[inside], points[inside]
    return points, gray[flat[:, 1], flat[:, 0]].astype(float)


class _Problem:
    """Residuals of pixels as a function of 17 parameters.

    They are the corners (8) [px], the blur's covariance (xx, xy, yy) [px^2], and black level and
    contrast, each with its slopes along u and v [grey levels].
    """

    def __init__(self, points: Floats, values: Floats, pattern: Floats) -> None:
        self._points, self._values, self._pattern = points, values, pattern
        self._cells = len(pattern) - 2

    def levels(self, x: Floats) -> Floats:
        """Levels (6,) that fit best; the white is at least as light as the black."""
        shape = self._shape(x)[0]
        basis = np.column_stack([np.ones_like(shape), shape])
        black, contrast = np.linalg.lstsq(basis, self._values, rcond=None)[0]
        return np.array([black, 0.0, 0.0, contrast, 0.0, 0.0])

    def linearised(self, x: Floats) -> tuple[Floats, Floats]:
        """Residuals (N,) and their Jacobian (N, 17)."""
        shape, by_u, by_v, by_su, by_sv, uv, slopes, su, sv = self._shape(x)
        position = 2 * uv / self._cells - 1
        ones = np.column_stack([np.ones(len(uv)), position])
        contrast = ones @ x[14:]
        residual = ones @ x[11:14] + contrast * shape - self._values
        jacobian = np.empty((len(uv), 17))
        pull = -contrast * (by_u * slopes[:, 0].T + by_v * slopes[:, 1].T)  # by the position (2, N)
        jacobian[:, :8] = _by_corners(x[:8].reshape(4, 2), self._cells, uv, self._points, pull)
        for column, (i, j, twice) in enumerate(((0, 0, 1.0), (0, 1, 2.0), (1, 1, 1.0)), 8):
            wider_u = twice * slopes[:, 0, i] * slopes[:, 0, j] / (2 * su)
            wider_v = twice * slopes[:, 1, i] * slopes[:, 1, j] / (2 * sv)
            jacobian[:, column] = contrast * (by_su * wider_u + by_sv * wider_v)
        jacobian[:, 11:14], jacobian[:, 14:] = ones, ones * shape[:, None]
        return residual, jacobian

    def _shape(self, x: Floats) -> tuple[Floats, ...]:
        """Blurred pattern at all pixels (N,), its slopes by u, v and the widths, and these."""
        forward = _from_cells(x[:8].reshape(4, 2), self._cells)
        matrix = np.asarray(np.linalg.inv(forward), dtype=float)
        uv, slopes = _mapped_with_slopes(matrix, self._points)
        covariance = np.array([[x[8], x[9]], [x[9], x[10]]])
        su, sv = np.sqrt(np.einsum("nki,ij,nkj->kn", slopes, covariance, slopes))
        a, a_u, a_s = _steps(uv[:, 0], su, self._cells)
        b, b_v, b_s = _steps(uv[:, 1], sv, self._cells)
        rows = b @ self._pattern
        shape, by_u, by_su = ((rows * part).sum(axis=1) for part in (a, a_u, a_s))
        columns = a @ self._pattern.T
        by_v, by_sv = ((columns * part).sum(axis=1) for part in (b_v, b_s))
        return shape, by_u, by_v, by_su, by_sv, uv, slopes, su, sv


def _steps(u: Floats, width: Floats, cells: int) -> tuple[Floats, Floats, Floats]:
    """Share of each cell in a blurred point (N, cells + 2), and its slopes by u and width."""
    z = (u[:, None] - np.arange(cells + 1)) / width[:, None]
    edge = ndtr(z)
    density = np.exp(-0.5 * z**2) / (np.sqrt(2 * np.pi) * width[:, None])
    rises = ((edge, 1.0), (density, 0.0), (-z * density, 0.0))
    full = [
        np.pad(rise, ((0, 0), (1, 1)), constant_values=((0, 0), (end, 0))) for rise, end in rises
    ]
    share, by_u, by_width = (rise[:, :-1] - rise[:, 1:] for rise in full)
    return share, by_u, by_width


def _valid(x: Floats) -> Floats:
    """Parameters with a blur that is at least the pixel's."""
    values, axes = np.linalg.eigh([[x[8], x[9]], [x[9], x[10]]])
    blur = axes @ np.diag(np.maximum(values, PIXEL_VARIANCE)) @ axes.T
    return np.concatenate([x[:8], [blur[0, 0], blur[0, 1], blur[1, 1]], x[11:]])


def _weight(residual: Floats, scale: float) -> Floats:
    """Tukey's weights of residuals (N,)."""
    return np.asarray(np.maximum(1.0 - (residual / (TUKEY * scale)) ** 2, 0.0) ** 2)


def _scale(residual: Floats) -> float:
    """Robust standard deviation [grey levels]."""
    return max(1.4826 * float(np.median(np.abs(residual))), LEAST_NOISE)


def _cost(residual: Floats, scale: float) -> float:
    """Tukey's cost of residuals."""
    clipped = np.maximum(1.0 - (residual / (TUKEY * scale)) ** 2, 0.0)
    return float(np.sum(1.0 - clipped**3))


def _equations(corners: Floats, cells: int) -> Floats:
    """Equations (8, 8) of the homography from cells to the view; rows x of all corners, then y."""
    u, v = np.array([0.0, cells, cells, 0.0]), np.array([0.0, 0.0, cells, cells])
    rows = np.zeros((2, 4, 8))
    for axis in (0, 1):
        start = 3 * axis
        rows[axis, :, start], rows[axis, :, start + 1], rows[axis, :, start + 2] = u, v, 1.0
        rows[axis, :, 6], rows[axis, :, 7] = -u * corners[:, axis], -v * corners[:, axis]
    return rows.reshape(8, 8)


def _from_cells(corners: Floats, cells: int) -> Floats:
    """Homography (3, 3) from cells to the view [px]."""
    entries = np.linalg.solve(_equations(corners, cells), corners.T.ravel())
    return np.append(entries, 1.0).reshape(3, 3)


def _by_corners(corners: Floats, cells: int, uv: Floats, points: Floats, pull: Floats) -> Floats:
    """Slopes (N, 8) by the corners of values with slopes ``pull`` (2, N) by the position."""
    matrix = _from_cells(corners, cells)
    depth = uv @ matrix[2, :2] + 1.0
    homogeneous = np.column_stack([uv, np.ones(len(uv))]) / depth[:, None]
    towards = -(points.T * pull).sum(axis=0)
    by_entries = np.column_stack(
        [
            homogeneous * pull[0][:, None],
            homogeneous * pull[1][:, None],
            homogeneous[:, :2] * towards[:, None],
        ]
    )
    square = np.array([[0, 0], [cells, 0], [cells, cells], [0, cells]])
    depths = np.tile(square @ matrix[2, :2] + 1.0, 2)
    entries = np.linalg.inv(_equations(corners, cells)) * depths  # slopes by x of all, then by y
    order = np.array([[0, 4], [1, 5], [2, 6], [3, 7]]).ravel()
    return by_entries @ entries[:, order]


def _mapped(matrix: Floats, points: Floats) -> Floats:
    """Points (N, 2) through a homography (3, 3)."""
    image = points @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(image[:, :2] / image[:, 2:])


def _mapped_with_slopes(matrix: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Points (N, 2) through a homography (3, 3), and their Jacobians (N, 2, 2)."""
    image = points @ matrix[:, :2].T + matrix[:, 2]
    mapped = image[:, :2] / image[:, 2:]
    slopes = matrix[None, :2, :2] - mapped[:, :, None] * matrix[None, 2:, :2]
    return mapped, slopes / image[:, 2, None, None]
