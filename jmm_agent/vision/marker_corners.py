"""Corners of a marker to a small part of a pixel: from lines along its edges, or from its pattern.

Lines are fast, and exact in sharp and clean frames. In all others, and where an edge is hidden, the
whole pattern is fitted.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jmm_agent.types import Floats
from jmm_agent.vision.corner_refinement import EdgeCorners, refine_corners
from jmm_agent.vision.marker_view import MarkerView
from jmm_agent.vision.pattern_fit import PatternFit, fit_pattern

FLOOR_PX = 0.01
"""Systematic error of a corner [px]."""
INFLATION = 3.0
"""Factor between the covariance of the fit and that of its errors; neighbouring pixels share
errors of the model."""
WHOLE = 0.9
"""Share of the pixels of a marker that is not hidden, at least ..."""
AGREED_CELLS = 0.25
"""... unless the corners of the lines and of the pattern are as close as this [cells]."""


class Corners(NamedTuple):
    """Corners in a view (4, 2) [px], and the covariance of their coordinates (8, 8) [px^2]."""

    points: Floats
    covariance: Floats

    @property
    def deviation_px(self) -> float:
        """Standard deviation of a coordinate [px]."""
        return float(np.sqrt(np.trace(self.covariance) / 8))


def locate_corners(
    gray: np.ndarray, quad: Floats, pattern: Floats, view: MarkerView
) -> Corners | None:
    """Corners of a marker.

    Args:
        gray: (H, W) uint8.
        quad: rough corners in the view (4, 2) [px], from the printed upper left one, clockwise as
            printed.
        pattern: the marker's cells with its black border (n, n): 0 black, 1 white.
        view: in which the edges are straight.

    Returns:
        The corners; None if the frame does not show the marker clearly enough.
    """
    lines = refine_corners(gray, quad, len(pattern), view)
    if lines is not None and lines.sharp:
        return _corners(lines.points, lines.deviation_px**2 * np.eye(8))
    fit = fit_pattern(gray, quad if lines is None else lines.points, pattern, view)
    if fit is None or not (fit.share >= WHOLE or _agree(fit, lines, len(pattern))):
        starts = [quad, *(_completed(quad, corner) for corner in range(4))]
        fits = [fit, *(fit_pattern(gray, start, pattern, view) for start in starts)]
        fit = max((f for f in fits if f is not None), key=_explained, default=None)
    if fit is not None:
        return _corners(fit.points, INFLATION * fit.covariance)
    if lines is not None:
        return _corners(lines.points, lines.deviation_px**2 * np.eye(8))
    return None


def _agree(fit: PatternFit, lines: EdgeCorners | None, cells: int) -> bool:
    """Whether lines along the edges lead to the corners of a fit."""
    if lines is None:
        return False
    edges = np.roll(fit.points, 1, axis=0) - fit.points
    reach = AGREED_CELLS * np.linalg.norm(edges, axis=1).min() / cells
    return bool(np.abs(fit.points - lines.points).max() < reach)


def _explained(fit: PatternFit) -> float:
    return fit.share


def _corners(points: Floats, covariance: Floats) -> Corners:
    return Corners(points, covariance + FLOOR_PX**2 * np.eye(8))


def _completed(quad: Floats, corner: int) -> Floats:
    """Rough corners, with one replaced by the fourth of the parallelogram of the others."""
    completed = np.array(quad, dtype=float)
    completed[corner] = quad[corner - 1] + quad[(corner + 1) % 4] - quad[corner - 2]
    return completed
