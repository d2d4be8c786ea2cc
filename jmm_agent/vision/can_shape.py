"""Shape and colour of a can, and the outline of its coloured part in the frame of a camera.

A can is an upright cylinder. Its side is painted in one colour between two rims, which have another
one. Of a cylinder around the axis a through the middle c, with the radius r, a camera at the origin
sees the points c + z a + r (cos(phi) u + sin(phi) v): u points from the axis to the camera, v is
a x u, and |phi| <= arccos(r / d) at the distance d of the camera from the axis. These limits of phi
are the same at all heights z, so that the outline of the painted part consists of an arc at its
upper end, one at its lower end, and two straight lines between them, from wherever it is seen.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal, NamedTuple

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.plain_numbers import real

CanKind = Literal["marker", "seen"]
"""How frames show a can: by the marker on it, or itself."""


@dataclass(frozen=True)
class CanShape:
    """Size and colour of a can; the defaults are those of the can of ``Kengoro/CanGrasp-v0``.

    Attributes:
        radius: of the can [m].
        height: of the can [m].
        rim: width of the rims at both ends, which are not painted [m].
        hue: of the paint on the circle of colours [deg]; 0 is red, 120 green, 240 blue.
        hue_width: largest difference of a pixel's hue from it [deg].
        saturation: least saturation of a painted pixel [1].

    Raises:
        AgentError: a value is no number, a size is not positive, the rims leave nothing between
            them, or the colour is none.
    """

    radius: float = 0.033
    height: float = 0.115
    rim: float = 0.0092
    hue: float = 1.0
    hue_width: float = 14.0
    saturation: float = 0.45

    def __post_init__(self) -> None:
        for field in fields(self):
            real(getattr(self, field.name), f"CanShape: {field.name}")
        if not (0.0 < self.radius < np.inf and 0.0 < self.height < np.inf):
            raise AgentError(
                f"CanShape: radius is {self.radius} m and height {self.height} m, but both must be "
                "positive and finite."
            )
        if not 0.0 <= self.rim < self.height / 2:
            raise AgentError(
                f"CanShape: rim is {self.rim} m, but must be at least 0 and less than half the "
                f"height, {self.height / 2:g} m."
            )
        if not (0.0 <= self.hue <= 360.0 and 0.0 < self.hue_width < 180.0):
            raise AgentError(
                f"CanShape: hue is {self.hue} deg and hue_width {self.hue_width} deg; the hue must "
                "be from 0 to 360, and the width between 0 and 180."
            )
        if not 0.0 < self.saturation < 1.0:
            raise AgentError(
                f"CanShape: saturation is {self.saturation}, but must lie between 0 and 1: a can "
                "without a colour is not found by it."
            )

    @property
    def half_paint(self) -> float:
        """Half the height of the painted part [m]."""
        return self.height / 2 - self.rim


class Can(NamedTuple):
    """Where a can is.

    Attributes:
        middle: of the cylinder, in the camera (3,) [m].
        axis: unit vector from its lower to its upper end, in the camera (3,).
    """

    middle: Floats
    axis: Floats


TURNS = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
"""Angle about the axis at the beginning and the end of each part of an outline [its limit]."""
HEIGHTS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]])
"""Height at the beginning and the end of each part [half the painted height]."""


class OutlinePoints(NamedTuple):
    """Which points of an outline are taken, in order around it: parts, and shares of their length.

    Attributes:
        part: of each point (n,): 0 the upper arc, 1 one side, 2 the lower arc, 3 the other side.
        share: of the part's length, from its beginning to the point (n,) [1].
    """

    part: np.ndarray
    share: Floats


def outline_points(counts: tuple[int, int], margin: float = 0.0) -> OutlinePoints:
    """Points of an outline at equal distances.

    Args:
        counts: number of points of each arc, and of each side.
        margin: share of each part's length that is left out at both of its ends [1].
    """
    numbers = (counts[0], counts[1], counts[0], counts[1])
    part = np.repeat(np.arange(4), numbers)
    share = np.concatenate([margin + (1 - 2 * margin) * (np.arange(n) + 0.5) / n for n in numbers])
    return OutlinePoints(part, share)


def outline(shape: CanShape, can: Can, points: OutlinePoints) -> Floats:
    """Points of the outline of the painted part, in the camera (n, 3) [m]; NaN from within a can.

    Args:
        shape: of the can.
        can: where it is.
        points: which are taken.
    """
    across = (can.middle @ can.axis) * can.axis - can.middle
    distance = float(np.linalg.norm(across))
    if distance <= shape.radius:
        return np.full((len(points.part), 3), np.nan)
    u = across / distance
    v = _cross(can.axis, u)
    widest = np.arccos(shape.radius / distance)
    ends, highs = TURNS[points.part], HEIGHTS[points.part]
    share = points.share
    phi = widest * (ends[:, 0] + share * (ends[:, 1] - ends[:, 0]))
    z = shape.half_paint * (highs[:, 0] + share * (highs[:, 1] - highs[:, 0]))
    around = np.cos(phi)[:, None] * u + np.sin(phi)[:, None] * v
    return np.asarray(can.middle + z[:, None] * can.axis + shape.radius * around)


def outline_pixels(
    shape: CanShape, can: Can, camera: Camera, points: OutlinePoints
) -> tuple[Floats, Floats]:
    """Pixels of points of the outline (n, 2), and normals outwards (n, 2); NaN where there is none.

    Args:
        shape: of the can.
        can: where it is.
        camera: that sees it.
        points: which are taken.
    """
    pixels = camera.project(outline(shape, can, points))
    step = 1e-3
    after = points._replace(share=points.share + step)
    before = points._replace(share=points.share - step)
    along = camera.project(outline(shape, can, after)) - camera.project(outline(shape, can, before))
    normals = np.stack([along[:, 1], -along[:, 0]], axis=-1)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return pixels, normals * np.sign(signed_area(pixels))


def signed_area(polygon: Floats) -> float:
    """Area of a polygon (n, 2), positive if it runs from x to y."""
    x, y = polygon.T
    return float(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def tilted(up: Floats, tilt: Floats) -> Floats:
    """Unit vector (3,) that departs from ``up`` (3,) by angles (2,) about two axes across it."""
    first, second = axes_across(up)
    axis = up + tilt[0] * first + tilt[1] * second
    return np.asarray(axis / np.linalg.norm(axis))


def axes_across(up: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors (3,) that are perpendicular to a unit vector (3,), and to each other."""
    other = np.eye(3)[int(np.argmin(np.abs(up)))]
    first = _cross(up, other)
    first /= np.linalg.norm(first)
    return first, _cross(up, first)


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross product of two vectors (3,); that of NumPy takes longer for so few numbers."""
    (ax, ay, az), (bx, by, bz) = a, b
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
