"""Visuals of the hand: palm, back with a motor box, horns of the wrist's wires, jointed fingers.

Back and palm differ, and so do the sides of thumb and little finger, by shape and plain colours, so
that each view of the hand can be told from every other one.
"""

from __future__ import annotations

import numpy as np
from parts import Visual
from shapes import Floats, Shape, box, cylinder, loft, plate, tube, turned, unit, vector

FINGERS = {"index": 0.0285, "middle": 0.0095, "ring": -0.0095, "little": -0.0285}
"""Place of each finger across the hand [m], as its geoms in arm.xml."""

PALM = np.array([0.0, 0.0, -0.043])
"""Middle of the geom `palm` of arm.xml [m]; it has half edges of 37, 11 and 37 mm."""

PLATE = np.array([0.062, -0.016, -0.026])
PLATE_NORMAL = np.array([np.sin(np.radians(55.0)), 0.0, np.cos(np.radians(55.0))])
"""Middle of the marker's plate [m], and where it faces, as in arm.xml."""

ROOT, JOINT, BEND = (
    np.array([0.0, 0.002, -0.080]),
    np.array([0.0, 0.0116, -0.0319]),
    np.array([0.0, 0.0103, -0.0194]),
)
"""The fingers' root in the hand, and each next joint from the one before [m], as in arm.xml."""

THICK = {"index": 0.0080, "middle": 0.0080, "ring": 0.0078, "little": 0.0070}
"""Half the width of each finger [m]; the geoms that touch have a radius of 8 mm."""


def hand() -> Visual:
    """Palm and back of the hand with the flange of the wrist."""
    visual = Visual("hand")
    _palm(visual)
    _back(visual)
    _inside(visual)
    _thumb_mount(visual)
    _horns(visual)
    return visual


def _palm(visual: Visual) -> None:
    """A body that widens from the wrist to the knuckles, more on the thumb's side."""
    levels = (  # height, little finger's side, thumb's side, back, palm [m]
        *((-0.005, -0.020, 0.022, -0.0085, 0.0085), (-0.016, -0.026, 0.030, -0.0105, 0.0100)),
        *((-0.032, -0.033, 0.0365, -0.0110, 0.0105), (-0.060, -0.0365, 0.0370, -0.0110, 0.0105)),
        (-0.078, -0.0365, 0.0370, -0.0095, 0.0095),
    )
    visual.add("bone", loft([_section(*level) for level in levels]))
    # Knuckles: a dark bar behind each finger's root, in a fork of the palm.
    for name, x in FINGERS.items():
        wide = 0.0060 if name != "little" else 0.0052
        at = ROOT + vector(x, 0, 0)
        visual.add("dark", cylinder(at - vector(wide, 0, 0), at + vector(wide, 0, 0), 0.0072, 8))


def _section(z: float, low: float, high: float, back: float, palm: float) -> Floats:
    """A horizontal section of the palm with cut corners (8, 3) [m]."""
    cut = 0.004
    x = [low, low + cut, high - cut, high, high, high - cut, low + cut, low]
    y = [back + cut, back, back, back + cut, palm - cut, palm, palm, palm - cut]
    return np.column_stack([x, y, np.full(8, z)])


def _back(visual: Visual) -> None:
    """Motor box towards the little finger, its screws, a connector, and the drum of the fingers."""
    outline = [(-0.0330, -0.020), (0.0085, -0.020), (0.0085, -0.044)]
    outline += [(-0.0020, -0.054), (-0.0330, -0.054)]
    visual.add("dark", _on_back(outline, -0.0105, -0.0200))
    lid = [(-0.0295, -0.0235), (0.0050, -0.0235), (0.0050, -0.0425)]
    lid += [(-0.0040, -0.0505), (-0.0295, -0.0505)]
    visual.add("blue", _on_back(lid, -0.0195, -0.0220))
    connector = [(-0.0200, -0.0085), (0.0040, -0.0085), (0.0070, -0.0165), (-0.0240, -0.0165)]
    visual.add("dark", _on_back(connector, -0.0085, -0.0140))
    screw = [(0, 0.0024), (0.0012, 0.0020), (0.0013, 0.0)]
    for x, z in ((-0.0265, -0.0270), (0.0020, -0.0270), (-0.0265, -0.0470), (0.0005, -0.0395)):
        visual.add("metal", turned((x, -0.0218, z), (0, -1, 0), screw, 6, ends=False))
    drum = np.array([0.0230, -0.0105, -0.034])
    flanges = [(0, 0.0105), (0.003, 0.0105), (0.004, 0.0075)]
    flanges += [(0.0085, 0.0075), (0.010, 0.0095), (0.012, 0.0095)]
    visual.add("metal", turned(drum, (0, -1, 0), flanges, 10))
    axle = drum + vector(0, -0.012, 0)
    visual.add("dark", cylinder(axle, axle + vector(0, -0.0015, 0), 0.0045, 8))
    _ridges(visual)


def _ridges(visual: Visual) -> None:
    """Ridges of different lengths to the knuckles, with a guide for each finger's tendon."""
    starts = ((0.026, -0.047), (0.012, -0.048), (-0.008, -0.055), (-0.024, -0.055))
    for (name, x), (begin, z) in zip(FINGERS.items(), starts, strict=True):
        ends = [(begin, -0.0112, z), (x, -0.0100, -0.0745)]
        visual.add("blue" if name == "index" else "bone", tube(ends, [0.0036, 0.0042], 6, "last"))
        visual.add("metal", box((x, -0.0118, -0.0700), (0.0045, 0.0042, 0.0026)))


def _on_back(outline: list[tuple[float, float]], low: float, high: float) -> Shape:
    """A block on the hand's back between two heights y, its corners (x, z) cut at the top [m]."""
    corners = np.array(outline)
    middle = corners.mean(axis=0)
    top = middle + 0.90 * (corners - middle)
    edge = low + 0.7 * (high - low)
    rows = ((corners, low), (corners, edge), (top, high))
    return loft([np.insert(xz, 1, y, axis=1) for xz, y in rows])


def _inside(visual: Visual) -> None:
    """Pads on the palm, flat enough to leave room for what is grasped."""
    heel = [
        (-0.033, -0.030),
        (-0.011, -0.022),
        (-0.009, -0.046),
        (-0.020, -0.056),
        (-0.034, -0.052),
    ]
    root = [(-0.034, -0.062), (0.034, -0.060), (0.034, -0.073), (-0.034, -0.073)]
    ball = [(0.018, -0.020), (0.034, -0.030), (0.035, -0.052), (0.020, -0.050), (0.0155, -0.036)]
    for outline in (heel, root, ball):
        points = np.insert(np.array(outline), 1, 0.0111, axis=1)
        visual.add("dark", plate(points, 0.0022, (0, 1, 0)))
    visual.add("metal", box((0.003, 0.0108, -0.054), (0.0085, 0.0012, 0.004)))
    for x in (-0.0285, 0.0285):
        visual.add(
            "metal",
            turned(
                (x, 0.0104, -0.0575), (0, 1, 0), [(0, 0.0022), (0.0012, 0.0018), (0.0012, 0.0)], 6
            ),
        )


def _thumb_mount(visual: Visual) -> None:
    """The joint of the thumb: two cheeks and an axle, and a stay on the thumb's side."""
    root = np.array([0.006, 0.006, -0.018])
    for x in (-0.0115, 0.0115):
        visual.add("metal", box(root + vector(x, 0.004, 0), (0.0022, 0.0095, 0.0085)))
    visual.add(
        "dark", cylinder(root - vector(0.0145, 0, 0), root + vector(0.0145, 0, 0), 0.0055, 10)
    )
    visual.add("blue", box((0.0365, -0.002, -0.050), (0.0022, 0.0062, 0.0150)))
    stay = [(0.033, -0.004, -0.026), PLATE - 0.014 * PLATE_NORMAL, PLATE - 0.001 * PLATE_NORMAL]
    visual.add("metal", tube(stay, 0.0036, 6, tips="none"))


def _horns(visual: Visual) -> None:
    """Four arms on the wrist's flange, at whose tips the wires of the wrist end."""
    visual.add("metal", cylinder((0, -0.0115, 0), (0, 0.0115, 0), 0.0085, 10))
    visual.add(
        "metal", loft([_section(z, -0.021, 0.023, -0.0120, 0.0120) for z in (-0.006, -0.013)])
    )
    for site, base in (
        *(("ecr_1", (0.016, -0.009, -0.0098)), ("fcr_1", (0.016, 0.009, -0.0098))),
        *(("ecu_1", (-0.012, -0.009, -0.0098)), ("fcu_1", (-0.014, 0.009, -0.0098))),
    ):
        visual.post(site, base, radius=0.0036)


def link(start: Floats, end: Floats, half: float, back: float, palm: float) -> Shape:
    """A finger's link between two joints (3,): a bar with cut corners, flat on its back [m].

    Args:
        start: first end [m].
        end: other end [m].
        half: half the width along x [m].
        back: thickness towards the back [m].
        palm: thickness towards the palm [m].
    """
    along = unit(end - start)
    out = np.array([0.0, -along[2], along[1]])  # towards the palm
    rows = []
    for at, share in ((start, 0.86), (start + 0.25 * (end - start), 1.0), (end, 0.88)):
        w, b, p = share * half, share * back, share * palm
        outline = ((-w, -0.45 * b), (-0.6 * w, -b), (0.6 * w, -b), (w, -0.45 * b))
        outline += ((w, 0.3 * p), (0.55 * w, p), (-0.55 * w, p), (-w, 0.3 * p))
        rows.append([at + vector(x, 0, 0) + y * out for x, y in outline])
    return loft(rows, ends=False)


def pad(start: Floats, end: Floats, half: float, height: float) -> Shape:
    """A pad on the palm side of a link [m]; arguments as for `link`."""
    along = unit(end - start)
    out = np.array([0.0, -along[2], along[1]])
    return box(
        0.5 * (start + end) + height * out,
        (half, 0.0011, 0.5 * float(np.linalg.norm(end - start))),
        z=-along,
    )


def fingers_proximal() -> Visual:
    """The first links of the four fingers."""
    visual = Visual("fingers_proximal")
    for name, x in FINGERS.items():
        half, at = THICK[name], np.array([x, 0.0, 0.0])
        start, end = at + 0.16 * JOINT, at + 0.86 * JOINT
        visual.add("blue" if name == "index" else "bone", link(start, end, half, 0.0072, 0.0072))
        visual.add("dark", pad(at + 0.32 * JOINT, at + 0.78 * JOINT, 0.6 * half, 0.0070))
        visual.add(
            "dark",
            box(
                at + 0.50 * JOINT + vector(0, -0.0078, -0.0025), (0.0028, 0.0018, 0.0035), z=-JOINT
            ),
        )
        joint = at + JOINT
        wide = 0.94 * half
        visual.add(
            "dark", cylinder(joint - vector(wide, 0, 0), joint + vector(wide, 0, 0), 0.0066, 8)
        )
    return visual


def fingers_distal() -> Visual:
    """The second links and the tips of the four fingers, bent and in one piece."""
    visual = Visual("fingers_distal")
    tip = np.array([0.0, 0.0141, -0.0095])
    for name, x in FINGERS.items():
        half, at = 0.95 * THICK[name], np.array([x, 0.0, 0.0])
        bend = at + BEND
        visual.add("bone", link(at + 0.22 * BEND, at + 0.95 * BEND, half, 0.0068, 0.0072))
        visual.add("dark", pad(at + 0.35 * BEND, at + 0.9 * BEND, 0.6 * half, 0.0070))
        end = bend + tip
        section = tube([bend, bend + 0.5 * tip, end], [0.0068, 0.0072, 0.0060], 8, "last")
        visual.add("dark", section)
        along = unit(tip)
        out = np.array([0.0, -along[2], along[1]])
        if name != "little":
            nail = box(bend + 0.62 * tip - 0.0066 * out, (0.0042, 0.0014, 0.0058), z=-along)
            visual.add("bone", nail)
    return visual


def thumb_proximal() -> Visual:
    """The first link of the thumb."""
    visual = Visual("thumb_proximal")
    joint = np.array([0.0, 0.0359, -0.0031])
    visual.add("blue", _thumb_link(0.12 * joint, 0.84 * joint, 0.0088))
    visual.add(
        "dark", cylinder(joint - vector(0.0085, 0, 0), joint + vector(0.0085, 0, 0), 0.0072, 10)
    )
    visual.add("dark", box(0.5 * joint + vector(0, 0, 0.0088), (0.0032, 0.0042, 0.0016)))
    return visual


def thumb_distal() -> Visual:
    """The second link of the thumb, with its tip."""
    visual = Visual("thumb_distal")
    tip = np.array([0.0, 0.0299, -0.0026])
    visual.add("bone", _thumb_link(0.22 * tip, 0.62 * tip, 0.0084))
    visual.add("dark", tube([0.60 * tip, 0.82 * tip, tip], [0.0082, 0.0086, 0.0070], 8, "last"))
    visual.add("bone", box(0.84 * tip + vector(0, 0, 0.0078), (0.0050, 0.0062, 0.0014)))
    return visual


def _thumb_link(start: Floats, end: Floats, half: float) -> Shape:
    """A link of the thumb, whose flat back looks up."""
    rows = []
    for at, share in ((start, 0.85), (start + 0.3 * (end - start), 1.0), (end, 0.88)):
        w = share * half
        outline = ((-w, -0.45 * w), (-0.6 * w, -w), (0.6 * w, -w), (w, -0.45 * w))
        outline += ((w, 0.4 * w), (0.5 * w, 0.95 * w), (-0.5 * w, 0.95 * w), (-w, 0.4 * w))
        rows.append([at + vector(x, 0, z) for x, z in outline])
    return loft(rows, ends=False)
