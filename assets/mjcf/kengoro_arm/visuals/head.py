"""Visuals of the head: skull, face with two eyes, neck."""

from __future__ import annotations

import numpy as np
from parts import Visual
from shapes import Floats, ball, box, cylinder, loft, plate, ring, tube, turned, unit, vector

TOP, CHIN = 0.318, 0.081
"""Crown and chin above the neck joint [m]: height 1670 mm, head 237 mm (Asano et al. 2017)."""

MIDDLE = 0.026
"""The face's middle left of the neck [m], a design choice: the camera sits in the right one of two
eyes, and is in the middle of the neck."""


def head() -> Visual:
    """Skull with two eyes, and a plate below for the wires of the neck."""
    visual = Visual("head")
    _cranium(visual)
    _face(visual)
    _anchors(visual)
    return visual


def jaw() -> Visual:
    """What of the head is below its camera: jaw and neck."""
    visual = Visual("head", "jaw")
    _jaw(visual)
    _neck(visual)
    return visual


def skull_ring(z: float, back: float, front: float, half: float, power: float = 2.6) -> Floats:
    """A horizontal section of the head (16, 3): a superellipse from back to front [m]."""
    angle = (np.arange(16) + 0.5) * np.pi / 8
    cos, sin = np.cos(angle), np.sin(angle)
    x = 0.5 * (front + back) + 0.5 * (front - back) * np.sign(cos) * np.abs(cos) ** (2 / power)
    y = MIDDLE + half * np.sign(sin) * np.abs(sin) ** (2 / power)
    return np.column_stack([x, y, np.full(16, z)])


def _cranium(visual: Visual) -> None:
    """The upper and rear shell; it ends above the eyes at the front."""
    rings = [
        *(skull_ring(0.205, -0.076, 0.110, 0.073), skull_ring(0.222, -0.082, 0.113, 0.075)),
        *(skull_ring(0.250, -0.084, 0.108, 0.074), skull_ring(0.278, -0.076, 0.094, 0.067)),
        *(skull_ring(0.300, -0.056, 0.070, 0.052), skull_ring(0.313, -0.026, 0.036, 0.028)),
        np.array([[0.003, MIDDLE, TOP]]),
    ]
    visual.add("bone", loft(rings))
    rear = [
        *(skull_ring(0.126, -0.050, 0.030, 0.056), skull_ring(0.150, -0.066, 0.030, 0.066)),
        *(skull_ring(0.180, -0.072, 0.030, 0.071), skull_ring(0.206, -0.076, 0.030, 0.073)),
    ]
    visual.add("bone", loft(rear))
    crest = [
        (x, MIDDLE, z)
        for x, z in (
            (0.1125, 0.224),
            (0.108, 0.250),
            (0.094, 0.278),
            (0.070, 0.300),
            (0.036, 0.313),
            (0.003, TOP),
            (-0.026, 0.313),
            (-0.056, 0.300),
            (-0.076, 0.278),
            (-0.084, 0.250),
            (-0.082, 0.222),
            (-0.076, 0.205),
        )
    ]
    visual.add("metal", tube(crest, 0.0035, 6))
    for side in (1, -1):
        ear, out = vector(0.012, MIDDLE + 0.070 * side, 0.186), vector(0, side, 0)
        visual.add("dark", cylinder(ear, ear + 0.012 * out, 0.026, 14))
        visual.add("metal", cylinder(ear + 0.012 * out, ear + 0.015 * out, 0.019, 14))
        visual.add("blue", cylinder(ear + 0.015 * out, ear + 0.017 * out, 0.008, 8))


def _face(visual: Visual) -> None:
    """A dark band with the eyes."""
    band = [skull_ring(z, 0.0, 0.086, 0.069) for z in (0.160, 0.206)]
    visual.add("dark", loft(band))
    forward = np.array([np.cos(np.pi / 6), 0.0, -0.5])
    for y in (0.0, 2 * MIDDLE):
        front = np.array([0.095, y, 0.188]) - 0.0005 * forward
        barrel = [(0.0, 0.015), (0.024, 0.0165), (0.028, 0.0145), (0.028, 0.0)]
        visual.add("metal", turned(front - 0.030 * forward, forward, barrel, 14))
        visual.add(
            "blue",
            turned(
                front - 0.003 * forward,
                forward,
                [(0.0, 0.0125), (0.0014, 0.0115), (0.0014, 0.0)],
                14,
            ),
        )
        visual.add(
            "dark",
            turned(
                front - 0.003 * forward,
                forward,
                [(0.0, 0.0075), (0.0024, 0.0065), (0.003, 0.0)],
                12,
            ),
        )


def _jaw(visual: Visual) -> None:
    """The lower half of the face, with a mouth."""
    rings = [
        *(skull_ring(CHIN, 0.046, 0.082, 0.024), skull_ring(0.088, 0.040, 0.094, 0.034)),
        *(skull_ring(0.112, 0.034, 0.100, 0.049), skull_ring(0.150, 0.006, 0.102, 0.064)),
        skull_ring(0.163, -0.010, 0.098, 0.067),
    ]
    visual.add("bone", loft(rings))
    visual.add("dark", box((0.099, MIDDLE, 0.113), (0.004, 0.022, 0.003)))


def _neck(visual: Visual) -> None:
    """A neck of vertebrae that turns with the head."""
    visual.add("dark", ball((0, 0, 0), 0.0185))
    column = [np.array([0.0, 0.0, 0.012]), np.array([0.004, 0.012, 0.122])]
    up = unit(column[1] - column[0])
    for at in np.arange(0.012, 0.105, 0.023):
        middle = column[0] + at * up
        visual.add(
            "bone",
            turned(
                middle, up, [(-0.0075, 0.015), (-0.004, 0.018), (0.004, 0.018), (0.0075, 0.015)]
            ),
        )
    visual.add("dark", cylinder(column[0], column[1], 0.012, 8))


def _anchors(visual: Visual) -> None:
    """The plate below the skull, and posts at which the wires of the neck end."""
    outline = [
        *((-0.098, -0.010), (-0.055, -0.082), (-0.026, -0.090), (0.024, -0.036), (0.040, 0.02)),
        *((0.024, 0.036), (-0.026, 0.090), (-0.055, 0.082), (-0.098, 0.010)),
    ]
    visual.add("metal", plate([(x, y, 0.124) for x, y in outline], 0.005, (0, 0, 1)))
    for name in ("scm", "splenius", "scalene", "semispinalis"):
        for side in ("left", "right"):
            site = f"{name}_{side}_1"
            if site != "semispinalis_right_1":  # both end at one point
                visual.post(site, visual.sites[site] + vector(0, 0, 0.026))
    visual.add("dark", ring((0.0, 0.010, 0.120), (0, 0, 1), 0.018, 0.004, 10))
