"""Search for markers in grey frames: rough corners of every marker of a dictionary.

The first pass is fast and finds most. Each further one finds markers that those before it miss: far
and near ones, in large frames, through blur, in the dark, and partly hidden.
"""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches

import cv2
import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats
from jmm_agent.vision.plain_numbers import is_whole

Candidate = tuple[int, Floats]
"""Id of a marker, and its rough corners (4, 2) [px]."""

WINDOW_PX = 43
"""Window of the first pass's adaptive threshold [px]; a smaller one would take a near marker's
border for an empty ring."""
APART = 0.02
"""Least distance of markers, in circumferences; larger, and a chequered ground swallows them."""
WHOLE_PX = 1000
"""Larger frames are first searched at a reduced size [px]."""
LEAST_PX = 8
"""Least side of a frame that can show a marker [px]; OpenCV fails on some smaller ones."""
DARK = 60.0
"""A frame whose lightest parts are darker than this [grey levels] is stretched."""
SAME_SHARE = 0.04
"""Rough corners as close as this share of the marker's side lead to the same corners [1]."""
WIDEST = 16
"""Widest border of a marker [cells]."""
ROUGH = 0.06
"""Largest distance of a hidden marker's outline from its polygon, in circumferences."""


class MarkerSearch:
    """Finds the markers of a dictionary.

    Args:
        dictionary: name of a predefined dictionary of OpenCV.
        border: width of the black border [cells].

    Attributes:
        count: number of markers in the dictionary.

    Raises:
        AgentError: there is no such dictionary, or the border is not a whole number from 1 to
            `WIDEST`.
    """

    def __init__(self, dictionary: str, border: int = 1) -> None:
        names = [name for name in dir(cv2.aruco) if name.startswith("DICT_")]
        if dictionary not in names:
            near = get_close_matches(str(dictionary), names, n=3, cutoff=0.5) or names
            raise AgentError(
                f"There is no marker dictionary {dictionary!r}; there are: {', '.join(near)}."
            )
        if not (is_whole(border) and 1 <= border <= WIDEST):
            raise AgentError(
                f"The border of a marker is {border!r} cells; it must be a whole number from 1 to "
                f"{WIDEST}."
            )
        self._dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
        self._border = int(border)
        self.count = len(self._dictionary.bytesList)
        self._first = self._detector(WINDOW_PX, WINDOW_PX)
        self._stock = self._detector(3, 23)
        self._wide = self._detector(13, WINDOW_PX)
        self._hidden = self._detector(13, WINDOW_PX, polygonalApproxAccuracyRate=ROUGH)

    def pattern(self, marker: int) -> Floats:
        """Cells of a marker with its black border (n, n): 0 black, 1 white.

        Args:
            marker: its id.
        """
        cells = self._dictionary.markerSize + 2 * self._border
        image = cv2.aruco.generateImageMarker(
            self._dictionary, marker, cells, borderBits=self._border
        )
        return (image > 127).astype(float)

    def first(self, gray: np.ndarray) -> list[Candidate]:
        """Markers that one pass finds.

        Args:
            gray: (H, W) uint8.
        """
        return _markers(self._first, _stretched(gray), _reduction(gray))

    def further(self, gray: np.ndarray) -> Iterator[list[Candidate]]:
        """Markers that further passes find, each more expensive than the one before.

        Args:
            gray: (H, W) uint8.
        """
        gray, reduction = _stretched(gray), _reduction(gray)
        while reduction > 1:
            yield _markers(self._stock, gray, reduction)
            reduction //= 2
            yield _markers(self._first, gray, reduction)
        yield _markers(self._stock, gray)
        yield _markers(self._blurred(max(gray.shape)), gray)
        if max(gray.shape) <= WHOLE_PX:
            twice = cv2.resize(gray, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
            yield [(i, (quad - 0.5) / 2) for i, quad in _markers(self._wide, twice)]
        yield _markers(self._hidden, gray)

    def _detector(self, smallest: int, largest: int, **settings: float) -> cv2.aruco.ArucoDetector:
        """Detector with windows of the adaptive threshold [px] in steps of 10."""
        parameters = cv2.aruco.DetectorParameters()
        parameters.markerBorderBits = self._border
        parameters.adaptiveThreshWinSizeMin = smallest
        parameters.adaptiveThreshWinSizeMax = largest
        parameters.minMarkerDistanceRate = APART
        for name, value in settings.items():
            setattr(parameters, name, value)
        return cv2.aruco.ArucoDetector(self._dictionary, parameters)

    def _blurred(self, largest_px: int) -> cv2.aruco.ArucoDetector:
        """Detector of AprilTag's authors, on a reduced frame; it finds edges through blur."""
        return self._detector(
            WINDOW_PX,
            WINDOW_PX,
            cornerRefinementMethod=cv2.aruco.CORNER_REFINE_APRILTAG,
            aprilTagQuadDecimate=float(max(2, 2 * largest_px // WHOLE_PX)),
        )


def overlap(quad: Floats, other: Floats) -> bool:
    """Whether two rough outlines (4, 2) [px] are those of one marker: their middles are close."""
    apart = float(np.linalg.norm(quad.mean(axis=0) - other.mean(axis=0)))
    return apart < 0.5 * min(side_of(quad), side_of(other))


def close(quad: Floats, other: Floats) -> bool:
    """Whether two rough outlines (4, 2) [px] lead to the same corners."""
    return bool(np.abs(quad - other).max() < SAME_SHARE * side_of(other))


def side_of(quad: Floats) -> float:
    """Mean side of an outline (4, 2) [px]."""
    return float(np.linalg.norm(np.roll(quad, 1, axis=0) - quad, axis=1).mean())


def _reduction(gray: np.ndarray) -> int:
    """Power of two by which a frame is reduced at first."""
    return int(2 ** max(0, np.ceil(np.log2(max(gray.shape) / WHOLE_PX))))


def _markers(
    detector: cv2.aruco.ArucoDetector, gray: np.ndarray, reduction: int = 1
) -> list[Candidate]:
    """Markers in a frame that is reduced first."""
    if reduction > 1:
        gray = cv2.resize(
            gray, None, fx=1 / reduction, fy=1 / reduction, interpolation=cv2.INTER_AREA
        )
    if min(gray.shape) < LEAST_PX:
        return []
    quads, found, _ = detector.detectMarkers(gray)
    ids = [] if found is None else [int(i) for i in found.ravel()]
    pairs = zip(ids, (quad[0] for quad in quads), strict=True)
    if reduction == 1:
        return list(pairs)
    return [(i, (quad + 0.5) * reduction - 0.5) for i, quad in pairs]


def _stretched(gray: np.ndarray) -> np.ndarray:
    """The frame; a dark one is smoothed, and its contrast stretched."""
    low, high = np.percentile(gray[::4, ::4], (1.0, 99.0))
    if high > DARK:
        return gray
    smooth = cv2.GaussianBlur(gray.astype(np.float32), (0, 0), 0.8)
    return np.clip((smooth - low) * (255 / max(high - low, 1.0)), 0, 255).astype(np.uint8)
