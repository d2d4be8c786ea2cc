"""What the visuals of all bodies have in common: colours, points of the wires, motors, anchors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike
from shapes import Floats, Shape, joined, ring, tube, turned, unit

FOLDER = Path(__file__).resolve().parents[1]

COLOURS = ("bone", "metal", "dark", "blue")
"""Each is a default class `visual_<colour>` in arm.xml."""

POST = 0.0032
"""Radius of the post that holds a wire's end [m], a design choice."""

EYELET = (0.0034, 0.0020)
"""Radius of a relay's ring, and of its bar [m]: the wire passes 1.8 mm from the ring."""


class Visual:
    """Shapes of one body, or of a part of it, by colour, in the body's frame.

    Args:
        body: name of the body.
        part: name of the part; that of the body if left out. Parts are left out of a picture one by
            one if they are outside of it.

    Attributes:
        sites: the body's sites of wires, by name (3,) [m].
    """

    def __init__(self, body: str, part: str = "") -> None:
        self._name = part or body
        self.sites = sites_of(body)
        self._shapes: dict[str, list[Shape]] = {}

    def add(self, colour: str, *shapes: Shape) -> None:
        """Add shapes of a colour."""
        if colour not in COLOURS:
            raise ValueError(f"unknown colour {colour!r}; valid are: {', '.join(COLOURS)}")
        self._shapes.setdefault(colour, []).extend(shapes)

    def meshes(self) -> dict[str, Shape]:
        """The shapes of each colour as one, by `<body or part>_<colour>`."""
        found = self._shapes.items()
        return {f"{self._name}_{colour}": joined(shapes) for colour, shapes in found}

    def post(
        self, site: str, *path: ArrayLike, colour: str = "metal", radius: float = POST
    ) -> None:
        """A post along a path (3,) [m] whose tip is a wire's end."""
        end = self.sites[site]
        points = [*(np.asarray(point, dtype=float) for point in path), end]
        points[-1] = end - radius * unit(end - points[-2])
        widths = np.linspace(1.5, 1.0, len(points)) * radius
        self.add(colour, tube(points, widths, sides=6, tips="cone"))

    def eyelet(self, site: str, axis: ArrayLike, *path: ArrayLike) -> None:
        """A ring through which a wire passes, on a post along a path (3,) [m]."""
        centre, (radius, bar) = self.sites[site], EYELET
        self.add("metal", ring(centre, axis, radius, bar))
        points = [np.asarray(point, dtype=float) for point in path]
        toward = unit(centre - points[-1])
        points.append(centre - radius * toward)
        widths = np.linspace(1.5, 1.0, len(points)) * POST
        self.add("metal", tube(points, widths, sides=6, tips="none"))

    def motor(
        self,
        site: str,
        front: ArrayLike,
        back: ArrayLike,
        radius: float = 0.011,
        sides: int = 8,
    ) -> None:
        """A motor from its front to its back (3,) [m], with a spout to a wire's end.

        Motors of 9 mm and more have a blue band.
        """
        front, axis = np.asarray(front, dtype=float), np.subtract(back, front)
        length = float(np.linalg.norm(axis))
        cap, band = 0.12 * length, (0.30 * length, 0.48 * length)
        end, small = self.sites[site], 0.85 * radius
        self.add("metal", turned(front, axis, [(0.0, small), (cap, radius)], sides))
        body = [(cap, radius), (length - cap, radius)]
        self.add("dark", turned(front, axis, body, sides, ends=False))
        if radius >= 0.009:
            wide = [(along, radius + 0.0006) for along in band]
            self.add("blue", turned(front, axis, wide, sides, ends=False))
        rear = [(length - cap, radius), (length, 0.8 * radius)]
        self.add("metal", turned(front, axis, rear, sides))
        tip = end - POST * unit(end - front)
        self.add("metal", tube([front, tip], [1.6 * POST, POST], sides=6, tips="cone"))


def sites_of(body: str) -> dict[str, Floats]:
    """The sites of wires of a body of arm.xml, by name (3,) [m]."""
    root = ElementTree.parse(FOLDER / "arm.xml").getroot()
    (found,) = (element for element in root.iter("body") if element.get("name") == body)
    sites = (site for site in found.findall("site") if site.get("class"))
    return {s.get("name", ""): np.array(s.get("pos", "").split(), dtype=float) for s in sites}


def mirrored(points: Sequence[ArrayLike]) -> list[Floats]:
    """Points (3,) on the other side of the plane y = 0."""
    return [np.asarray(point, dtype=float) * (1, -1, 1) for point in points]
