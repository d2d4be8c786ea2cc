"""Shapes of triangles: tubes along a path, turned parts, plates, lofts, boxes and rings.

A shape is (vertices (n, 3) [m], faces (k, 3)), its faces counter-clockwise as seen from outside.
Ends that other shapes hide are open: each face takes time to render.
`with_normals` makes edges sharp where two faces meet at a large angle, and round elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Shape = tuple[Floats, NDArray[np.int64]]

CREASE = np.cos(np.radians(50.0))
"""Cosine of the angle between two faces above which their edge is sharp."""


def vector(x: float, y: float, z: float) -> Floats:
    """A vector (3,)."""
    return np.array([x, y, z])


def unit(direction: ArrayLike) -> Floats:
    """A vector (3,) of length 1 in a direction (3,)."""
    direction = np.asarray(direction, dtype=float)
    return direction / np.linalg.norm(direction)


def across(axis: ArrayLike) -> tuple[Floats, Floats]:
    """Two unit vectors that make a right-handed frame with an axis: (first, second, axis)."""
    axis = unit(axis)
    least = np.zeros(3)
    # Of two that are equal but for rounding, which differs between processors, the first one.
    least[np.argmin(np.round(np.abs(axis), 9))] = 1.0
    first = unit(np.cross(least, axis))
    return first, np.cross(axis, first)


def circle(sides: int) -> Floats:
    """Points (sides, 2) on a circle of radius 1; a side, not a corner, points along the first."""
    angle = (np.arange(sides) + 0.5) * 2 * np.pi / sides
    return np.column_stack([np.cos(angle), np.sin(angle)])


def loft(sections: Sequence[ArrayLike], ends: bool = True) -> Shape:
    """A shape through polygons with equally many corners.

    Args:
        sections: convex polygons (n, 3) [m]; one of a single point (1, 3) closes an end to a tip.
        ends: whether the ends are closed; not where another shape hides them.
    """
    rings = [np.atleast_2d(np.asarray(ring, dtype=float)) for ring in sections]
    start = np.cumsum([0, *(len(ring) for ring in rings)])
    faces = []
    for k in range(len(rings) - 1):
        one, other = len(rings[k]), len(rings[k + 1])
        for i in range(max(one, other)):
            j = (i + 1) % max(one, other)
            a, b = start[k] + i % one, start[k] + j % one
            c, d = start[k + 1] + i % other, start[k + 1] + j % other
            if one > 1:
                faces.append((a, b, d if other > 1 else c))
            if other > 1:
                faces.append((a, d, c))
    if ends:
        last, count = start[-2], len(rings[-1])
        faces += [(0, i + 1, i) for i in range(1, len(rings[0]) - 1)]
        faces += [(last, last + i, last + i + 1) for i in range(1, count - 1)]
    return outward((np.vstack(rings), np.array(faces)))


def outward(shape: Shape) -> Shape:
    """A shape with its faces turned outwards, if they are all turned to one side."""
    vertices, faces = shape
    a, b, c = (vertices[faces[:, i]] - vertices.mean(axis=0) for i in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum()
    return vertices, faces if volume > 0 else faces[:, ::-1]


def box(
    centre: ArrayLike, half: ArrayLike, x: ArrayLike = (1, 0, 0), z: ArrayLike = (0, 0, 1)
) -> Shape:
    """A box with its first and third axis along ``x`` and ``z``.

    Args:
        centre: its middle (3,) [m].
        half: half its edges (3,) [m].
        x: direction of the first axis (3,).
        z: direction of the third axis (3,), made perpendicular to the first.
    """
    first = unit(x)
    third = unit(np.asarray(z, dtype=float) - np.dot(z, first) * first)
    axes = np.array([first, np.cross(third, first), third])
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    levels = [np.column_stack([corners, np.full(4, level)]) for level in (-1, 1)]
    return loft([np.asarray(centre) + level * half @ axes for level in levels])


def turned(
    start: ArrayLike,
    axis: ArrayLike,
    profile: Sequence[tuple[float, float]],
    sides: int = 10,
    ends: bool = True,
) -> Shape:
    """A turned part.

    Args:
        start: where the axis begins (3,) [m].
        axis: its direction (3,).
        profile: (distance along the axis, radius) of each section [m].
        sides: number of corners of a section.
        ends: whether the ends are closed.
    """
    first, second = across(axis)
    ring = circle(sides) @ np.array([first, second])
    base = np.asarray(start, dtype=float)
    sections = []
    for along, radius in profile:
        middle = base + along * unit(axis)
        sections.append(middle + radius * ring if radius > 0 else middle[None])
    return loft(sections, ends)


def cylinder(one: ArrayLike, other: ArrayLike, radius: float, sides: int = 10) -> Shape:
    """A cylinder from one point to another (3,) [m]."""
    axis = np.asarray(other, dtype=float) - one
    return turned(one, axis, [(0.0, radius), (float(np.linalg.norm(axis)), radius)], sides)


def ball(centre: ArrayLike, radius: float, sides: int = 10, rings: int = 4) -> Shape:
    """A sphere with ``rings`` rings of faces less two."""
    angles = np.linspace(0, np.pi, rings + 2)
    profile = [(-radius * np.cos(a), radius * np.sin(a)) for a in angles]
    profile[0], profile[-1] = (-radius, 0.0), (radius, 0.0)
    return turned(centre, (0, 0, 1), profile, sides)


def tube(points: ArrayLike, radii: ArrayLike, sides: int = 8, tips: str = "both") -> Shape:
    """A round bar along a path.

    Args:
        points: the path (n, 3) [m].
        radii: at each point (n,), or one for all [m].
        sides: number of corners of a section.
        tips: which ends are closed, and so end a radius after the path: "both" or the "last" one
            by round tips, the last one by a "cone", or "none"; the others are open.
    """
    path = np.asarray(points, dtype=float)
    radii = np.broadcast_to(np.asarray(radii, dtype=float), len(path))
    steps = np.diff(path, axis=0)
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    tangents = np.vstack([steps[:1], steps[1:] + steps[:-1], steps[-1:]])
    first = across(tangents[0])[0]
    sections: list[Floats] = []
    for point, radius, tangent in zip(path, radii, tangents, strict=True):
        tangent = unit(tangent)
        first = unit(first - first @ tangent * tangent)
        second = np.cross(tangent, first)
        sections.append(point + radius * circle(sides) @ np.array([first, second]))
    if tips != "none":
        tip = _tip(path[-1], radii[-1] * steps[-1], sections[-1])
        sections += tip[1:] if tips == "cone" else tip
    if tips == "both":
        sections = [*_tip(path[0], -radii[0] * steps[0], sections[0])[::-1], *sections]
    return loft(sections, ends=False)


def _tip(end: Floats, step: Floats, section: Floats) -> list[Floats]:
    """Two sections that round off the end (3,) of a bar, a step (3,) of its radius long [m]."""
    return [end + 0.7 * step + 0.7 * (section - end), (end + step)[None]]


def ring(
    centre: ArrayLike,
    axis: ArrayLike,
    radius: float,
    thickness: float,
    sides: int = 8,
    section: int = 4,
) -> Shape:
    """A ring: a closed round bar of radius ``thickness`` [m] on a circle of ``radius`` [m]."""
    first, second = across(axis)
    points, faces = [], []
    for i, (cos, sin) in enumerate(circle(sides)):
        out = cos * first + sin * second
        middle = np.asarray(centre) + radius * out
        for j, (a, b) in enumerate(circle(section)):
            points.append(middle + thickness * (a * out + b * unit(axis)))
            at = [(i + p) % sides * section + (j + q) % section for p in (0, 1) for q in (0, 1)]
            faces += [(at[0], at[1], at[3]), (at[0], at[3], at[2])]
    return outward((np.array(points), np.array(faces)))


def plate(outline: ArrayLike, thickness: float, normal: ArrayLike) -> Shape:
    """A plate of even thickness.

    Args:
        outline: corners of its middle (n, 3) [m], star-shaped about their mean.
        thickness: of the plate [m].
        normal: direction across the plate (3,).
    """
    middle, step = np.asarray(outline, dtype=float), 0.5 * thickness * unit(normal)
    centre = middle.mean(axis=0, keepdims=True)
    return loft([centre - step, middle - step, middle + step, centre + step])


def joined(shapes: Sequence[Shape]) -> Shape:
    """Several shapes as one."""
    start = np.cumsum([0, *(len(vertices) for vertices, _ in shapes)])
    faces = [part + at for (_, part), at in zip(shapes, start, strict=False)]
    return np.vstack([vertices for vertices, _ in shapes]), np.vstack(faces)


def with_normals(shape: Shape) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Vertices, their normals and the faces, with a vertex for each side of a sharp edge.

    Faces without an area are left out.
    """
    vertices, faces = shape
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    area = np.cross(b - a, c - a)
    size = np.linalg.norm(area, axis=1)
    faces, area, size = faces[size > 1e-10], area[size > 1e-10], size[size > 1e-10]
    normal = area / size[:, None]
    near: dict[int, list[int]] = {}
    for i, face in enumerate(faces):
        for vertex in face:
            near.setdefault(int(vertex), []).append(i)
    found: dict[tuple[int, ...], int] = {}
    points, normals, corners = [], [], []
    for i, face in enumerate(faces):
        for vertex in face:
            others = np.array(near[int(vertex)])
            smooth = others[normal[others] @ normal[i] > CREASE]
            mean = unit(area[smooth].sum(axis=0))
            key = (int(vertex), *np.rint(mean * 50).astype(int))
            if key not in found:
                found[key] = len(points)
                points.append(vertices[vertex])
                normals.append(mean)
            corners.append(found[key])
    return np.array(points), np.array(normals), np.array(corners).reshape(-1, 3)
