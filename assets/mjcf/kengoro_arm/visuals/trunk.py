"""Visuals of the thorax, with spine and pelvis."""

from __future__ import annotations

import numpy as np
from parts import Visual, mirrored
from shapes import Floats, ball, box, cylinder, loft, plate, tube, turned, unit, vector

CHEST, CHEST_SIZE = np.array([-0.022, 0.0, -0.147]), np.array([0.080, 0.125, 0.170])
"""Middle and half axes of the ellipsoid `rib_cage` of arm.xml [m]."""

RIBS = (-0.035, -0.070, -0.105, -0.140, -0.175, -0.210, -0.245)
"""Heights of the ribs at the spine [m]; they fall by `SLOPE` to the front. Design choices."""
SLOPE = 0.022


def rib_point(angle: float, height: float) -> Floats:
    """A point of the rib cage's ellipsoid (3,): angle from the back, positive to the left [rad]."""
    z = height - SLOPE * 0.5 * (1 - np.cos(angle))
    share = np.sqrt(max(1 - ((z - CHEST[2]) / CHEST_SIZE[2]) ** 2, 0.0))
    x, y = CHEST[:2] + share * CHEST_SIZE[:2] * (-np.cos(angle), np.sin(angle))
    return np.array([x, y, z])


def spine_point(z: float) -> Floats:
    """The spine's middle (3,) at a height [m]; its upper part is the capsule `spine` of arm.xml."""
    if z > -0.30:
        return np.array([-0.09 + (z + 0.30) / 0.33 * 0.02, 0.0, z])
    return np.array([-0.09 + 0.02 * (-0.30 - z) / 0.16, 0.0, z])


def thorax() -> Visual:
    """The trunk, which does not move."""
    visual = Visual("thorax")
    _spine(visual)
    _rib_cage(visual)
    _pelvis(visual)
    _girdle_mounts(visual)
    _neck_mounts(visual)
    _neck_motors(visual)
    _chest_motors(visual)
    _back_motors(visual)
    return visual


def _spine(visual: Visual) -> None:
    """Vertebrae with discs between them, from the neck joint to the pelvis."""
    step = 0.0305
    for z in np.arange(0.018, -0.46, -step):
        middle, up = spine_point(z), unit(spine_point(z + 0.01) - spine_point(z - 0.01))
        body = [(-0.010, 0.016), (-0.006, 0.0185), (0.006, 0.0185), (0.010, 0.016)]
        visual.add("bone", turned(middle, up, body))
        visual.add("dark", turned(middle - step * up, up, [(0.009, 0.014), (0.022, 0.014)], 8))
        back = middle + vector(-0.026, 0, -0.004)
        visual.add("bone", box(back, (0.010, 0.0035, 0.008), z=(0.25, 0, 1)))
    neck = [spine_point(0.028), (-0.062, 0, 0.040), (-0.045, 0, 0.046)]
    visual.add("metal", tube(neck, [0.014, 0.013, 0.015]))


def _rib_cage(visual: Visual) -> None:
    """Seven pairs of ribs from the spine to the breastbone."""
    for i, height in enumerate(RIBS):  # the last two end at the side of the belly
        front = np.radians(174.0 if i < 5 else 150.0 - 12.0 * (i - 5))
        angles = np.linspace(np.radians(6.0), front, 11)
        half = [rib_point(angle, height) for angle in angles]
        radii = 0.0055 - 0.0012 * np.linspace(0, 1, len(half))
        for side in (half, mirrored(half)):
            visual.add("bone", tube([spine_point(height), *side], [0.0055, *radii], 6, tips="none"))
    middle = [rib_point(np.pi, z) for z in (-0.020, -0.055, -0.100, -0.150, -0.200)]
    widths = (0.030, 0.022, 0.017, 0.020, 0.008)
    out = np.array([0.004, 0, 0])
    rows = [
        [
            p - out - vector(0, w, 0),
            p + out - vector(0, 0.8 * w, 0),
            p + out + vector(0, 0.8 * w, 0),
            p - out + vector(0, w, 0),
        ]
        for p, w in zip(middle, widths, strict=True)
    ]
    visual.add("metal", loft(rows))


def _pelvis(visual: Visual) -> None:
    """Sacrum, two wings, a front bar and two hip flanges, on top of the stand."""
    visual.add("metal", box((-0.080, 0, -0.485), (0.022, 0.030, 0.030)))
    for side in (1, -1):
        outline = [
            *((-0.105, 0.030, -0.455), (-0.095, 0.085, -0.430), (-0.035, 0.125, -0.425)),
            *((0.010, 0.115, -0.455), (-0.020, 0.090, -0.510), (-0.075, 0.035, -0.520)),
        ]
        corners = np.array(outline) * (1, side, 1)
        visual.add("bone", plate(corners, 0.012, (0.30, -0.45 * side, 0.84)))
        crest = np.array(outline)[:4] * (1, side, 1)
        visual.add("bone", tube(crest, 0.008, 6))
        visual.add(
            "bone",
            tube(
                np.array([outline[3], (0.015, 0.05, -0.520), (0.018, 0.0, -0.530)]) * (1, side, 1),
                0.009,
                6,
            ),
        )
        hip, out = vector(-0.045, 0.085 * side, -0.525), vector(0, side, 0)
        visual.add("dark", cylinder(hip - 0.025 * out, hip + 0.020 * out, 0.032, 12))
        visual.add("metal", cylinder(hip + 0.020 * out, hip + 0.026 * out, 0.026, 12))
    visual.add("metal", cylinder((-0.045, -0.07, -0.525), (-0.045, 0.07, -0.525), 0.014))
    visual.add("metal", box((-0.075, 0, -0.520), (0.035, 0.030, 0.012)))


def _girdle_mounts(visual: Visual) -> None:
    """The top of the breastbone, and on the left a flange for an arm that is not there."""
    visual.add("metal", box((0.004, 0, -0.006), (0.012, 0.024, 0.015)))
    for side in (1, -1):
        visual.add("dark", ball((0.0072, 0.0292 * side, 0.0079), 0.0125))
    left = [(0.0072, 0.0292, 0.0079), (-0.020, 0.080, 0.015), (-0.0661, 0.145, 0.020)]
    visual.add("bone", tube(left, [0.008, 0.007, 0.009]))
    visual.add(
        "bone",
        tube([(-0.080, 0.012, 0.010), (-0.085, 0.080, 0.012), (-0.0661, 0.145, 0.020)], 0.006, 6),
    )
    visual.add("dark", cylinder((-0.062, 0.140, -0.010), (-0.062, 0.172, -0.010), 0.034, 14))
    visual.add("blue", cylinder((-0.062, 0.172, -0.010), (-0.062, 0.176, -0.010), 0.027, 14))


def _neck_mounts(visual: Visual) -> None:
    """The cup of the neck joint, and masts for wires that begin beside the neck."""
    visual.add(
        "metal",
        turned(
            (-0.045, 0, 0.034),
            (0, 0, 1),
            [(0, 0.012), (0.004, 0.024), (0.014, 0.026), (0.014, 0.0)],
            12,
        ),
    )
    visual.post(
        "lev_scap_0",
        (-0.080, -0.012, 0.010),
        (-0.084, -0.056, 0.030),
        (-0.070, -0.060, 0.090),
        radius=0.0036,
    )
    visual.post(
        "trap_clav_0",
        (-0.080, -0.012, 0.015),
        (-0.078, -0.034, 0.045),
        (-0.060, -0.031, 0.100),
        radius=0.0036,
    )


def _neck_motors(visual: Visual) -> None:
    """Motors of the neck, in front on the collar bones, and behind on a plate."""
    for side, name in ((1, "left"), (-1, "right")):
        visual.motor(
            f"scm_{name}_0", (0.024, 0.025 * side, 0.006), (0.016, 0.036 * side, -0.034), 0.009
        )
        visual.add(
            "metal",
            tube(
                [(0.004, 0, 0.008), (0.006, 0.06 * side, 0.006), (-0.018, 0.105 * side, 0.000)],
                0.0045,
                6,
            ),
        )
        visual.motor(
            f"scalene_{name}_0",
            (-0.015, 0.105 * side, 0.010),
            (-0.020, 0.100 * side, -0.032),
            0.010,
        )
        visual.motor(
            f"splenius_{name}_0",
            (-0.126, 0.012 * side, -0.014),
            (-0.126, 0.016 * side, -0.060),
            0.010,
        )
        visual.motor(
            f"semispinalis_{name}_0",
            (-0.126, 0.070 * side, -0.006),
            (-0.126, 0.070 * side, -0.054),
            0.011,
        )
        visual.add("metal", box((-0.112, 0.044 * side, -0.032), (0.004, 0.042, 0.016)))


def _chest_motors(visual: Visual) -> None:
    """Motors of the wires to arm and shoulder blade that begin on the ribs' front and side."""
    visual.motor("pec_major_0", (0.061, 0.004, -0.080), (0.066, 0.048, -0.098))
    visual.add("metal", box((0.058, 0.024, -0.088), (0.005, 0.020, 0.008), x=(1, 0, -0.1)))
    visual.motor("pec_minor_0", (0.034, -0.124, -0.104), (0.036, -0.112, -0.158), 0.0095)
    visual.motor("serr_sup_2", (0.013, -0.131, -0.096), (0.014, -0.121, -0.150), 0.0095)
    visual.add("metal", box((0.022, -0.106, -0.128), (0.016, 0.010, 0.014)))
    visual.motor("serr_inf_2", (-0.001, -0.158, -0.203), (-0.002, -0.138, -0.252))
    visual.add(
        "metal", tube([rib_point(-np.pi / 2, -0.175), (-0.002, -0.143, -0.222)], 0.007, 6, "none")
    )
    for name, height, axis in (
        ("serr_inf_1", -0.105, (0.2, 0.1, 1)),
        ("serr_sup_1", -0.070, (1, 0.3, -0.4)),
    ):
        base = rib_point(-np.radians(78.0 if name == "serr_inf_1" else 62.0), height)
        visual.eyelet(name, axis, base)
    visual.motor("subclav_0", (0.034, -0.062, -0.004), (0.037, -0.034, -0.030), 0.009)
    visual.add("metal", tube([(0.010, -0.015, -0.016), (0.036, -0.042, -0.022)], 0.005, 6, "none"))


def _back_motors(visual: Visual) -> None:
    """Motors beside the spine."""
    visual.motor("trap_sup_0", (-0.094, 0.030, 0.066), (-0.104, 0.034, 0.012), 0.0105)
    visual.add("metal", box((-0.090, 0.018, 0.022), (0.010, 0.016, 0.010)))
    visual.post("trap_mid_0", (-0.100, 0.034, 0.030), colour="metal")
    visual.post("rhomb_0", (-0.072, 0.000, 0.020))
    visual.motor("trap_inf_0", (-0.118, -0.026, -0.182), (-0.120, -0.026, -0.232))
    visual.add("metal", box((-0.104, -0.016, -0.206), (0.010, 0.012, 0.012)))
    visual.motor("lat_dorsi_0", (-0.108, 0.012, -0.250), (-0.110, 0.062, -0.256))
    visual.add("metal", box((-0.096, 0.030, -0.252), (0.008, 0.016, 0.010)))
    visual.eyelet("lat_dorsi_1", (0.3, -0.8, 0.5), (-0.090, -0.004, -0.262))
