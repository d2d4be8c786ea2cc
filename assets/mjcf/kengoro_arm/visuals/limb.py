"""Visuals of collar bone, shoulder blade, upper arm and forearm."""

from __future__ import annotations

import numpy as np
from parts import Visual
from shapes import ball, box, cylinder, plate, tube, turned, unit, vector

SHOULDER = np.array([0.0188, -0.0213, -0.0388])
"""Middle of the shoulder's ball in the shoulder blade (`sh_pitch_link` of arm.xml) [m]."""

ELBOW = np.array([0.0057, 0.0114, -0.2698])
"""Middle of the elbow in the upper arm (`ulna` of arm.xml) [m]."""

WRIST = np.array([0.0204, -0.0283, -0.2737])
"""Middle of the wrist in the radius (`wrist_link` of arm.xml) [m]."""


def clavicle() -> Visual:
    """A bent bar from breastbone to shoulder blade."""
    visual = Visual("clavicle")
    end = np.array([-0.0733, -0.1226, 0.0124])
    bar = [(0, 0, 0), (-0.010, -0.035, 0.010), (-0.045, -0.080, 0.010), 0.97 * end]
    visual.add("bone", tube(bar, [0.009, 0.007, 0.0065, 0.009]))
    visual.motor("delt_ant_0", (-0.046, -0.074, 0.022), (-0.022, -0.035, 0.026), 0.0095)
    visual.add("metal", box((-0.034, -0.060, 0.013), (0.006, 0.014, 0.006), x=(0.83, -0.55, 0)))
    visual.post("trap_clav_1", (-0.060, -0.103, 0.012))
    visual.post("subclav_1", (-0.040, -0.070, 0.008), (-0.062, -0.060, -0.010))
    return visual


def scapula() -> Visual:
    """A triangular blade with a ridge, a socket, and arms that lead wires round the shoulder."""
    visual = Visual("scapula")
    _blade(visual)
    _shoulder_arms(visual)
    for site, base in (
        *(("serr_inf_0", (-0.092, 0.060, -0.116)), ("serr_sup_0", (-0.088, 0.062, -0.118))),
        *(("rhomb_1", (-0.090, 0.057, -0.112)), ("lev_scap_1", (-0.096, 0.060, -0.022))),
        *(("trap_inf_1", (-0.096, 0.060, -0.020)), ("trap_mid_1", (-0.052, 0.031, -0.010))),
        *(("subscap_0", (-0.090, 0.054, -0.072)), ("triceps_0", (-0.022, 0.009, -0.070))),
    ):
        visual.post(site, base)
    visual.post("trap_sup_1", (-0.040, 0.020, -0.008), (-0.060, -0.012, 0.010))
    visual.motor("infraspin_0", (-0.084, 0.070, -0.084), (-0.088, 0.076, -0.036))
    visual.add("metal", box((-0.092, 0.068, -0.060), (0.008, 0.008, 0.010)))
    return visual


def _blade(visual: Visual) -> None:
    """The blade between the capsules of arm.xml, its ridge, and the socket of the shoulder."""
    rim = (
        *((-0.096, 0.060, -0.020), (-0.099, 0.063, -0.075), (-0.095, 0.060, -0.125)),
        *((-0.040, 0.022, -0.084), (0.004, -0.010, -0.050), (-0.006, 0.000, -0.022)),
    )
    corners = np.array(rim)
    normal = np.cross(corners[2] - corners[0], corners[4] - corners[0])
    visual.add("bone", plate(corners, 0.005, normal))
    visual.add("bone", tube([*corners, corners[0]], 0.0055, 6))
    ridge = [corners[0], (-0.050, 0.028, -0.004), (-0.010, 0.000, 0.004), (0.004, -0.024, 0.006)]
    visual.add("bone", tube(ridge, [0.006, 0.0075, 0.0085, 0.010]))
    visual.add("metal", ball((0, 0, 0.004), 0.013))
    medial = unit((-0.55, 0.80, 0.15))
    socket = [(-0.024, 0.019), (-0.020, 0.0265), (-0.012, 0.0285), (-0.012, 0.024)]
    visual.add("dark", turned(SHOULDER, -medial, [(s, r) for s, r in socket] + [(-0.018, 0.0)], 14))
    visual.add("metal", tube([(0.0, -0.004, -0.045), SHOULDER + 0.022 * medial], [0.009, 0.013], 8))


def _shoulder_arms(visual: Visual) -> None:
    """The acromion, from which arms carry the rings of the deltoids, and the coracoid."""
    roof = np.array([0.004, -0.026, 0.006])
    visual.add(
        "bone",
        plate(
            [
                (-0.020, -0.006, 0.004),
                (-0.012, -0.036, 0.006),
                (0.012, -0.040, 0.010),
                (0.024, -0.018, 0.010),
                (0.006, 0.002, 0.006),
            ],
            0.007,
            (-0.1, 0, 1),
        ),
    )
    visual.eyelet("delt_ant_1", (0.3, -0.3, -0.9), roof, (0.040, -0.036, 0.020))
    visual.eyelet("delt_mid_1", (0.4, -0.5, -0.75), roof, (0.022, -0.056, 0.022))
    visual.eyelet(
        "delt_post_1", (0.45, -0.6, -0.6), (-0.010, -0.024, 0.004), (-0.014, -0.044, -0.010)
    )
    visual.post("delt_mid_0", (0.000, -0.018, 0.000))
    visual.motor("delt_post_0", (-0.046, 0.002, -0.022), (-0.072, 0.026, -0.044), 0.0095)
    visual.add(
        "bone",
        tube(
            [(0.002, 0.000, -0.022), (0.022, 0.014, -0.016), (0.032, 0.013, -0.021)],
            [0.009, 0.007, 0.005],
            6,
        ),
    )
    visual.post("biceps_0", (0.026, 0.014, -0.018), radius=0.004)
    visual.post("pec_minor_1", (0.020, 0.013, -0.016), (0.040, 0.026, -0.010))


def humerus() -> Visual:
    """The upper arm: ball, shaft, fork of the elbow, and modules of motors."""
    visual = Visual("humerus")
    visual.add("metal", ball((-0.003, 0.002, 0.005), 0.0228, 14, 6))
    down = unit(ELBOW)
    shaft = [
        (0.0, 0.017),
        (0.03, 0.0125),
        (0.06, 0.0105),
        (0.20, 0.0105),
        (0.235, 0.014),
        (0.25, 0.014),
    ]
    visual.add("bone", turned((0, 0, 0), down, [(s, r) for s, r in shaft], 10))
    for y in (0.0125, -0.0125):  # the fork of the elbow
        arm = ELBOW + vector(0, y, 0)
        visual.add(
            "metal",
            plate(
                [
                    arm + p
                    for p in (
                        (-0.013, 0, 0.034),
                        (0.013, 0, 0.034),
                        (0.0145, 0, 0.0),
                        (0.009, 0, -0.0115),
                        (-0.009, 0, -0.0115),
                        (-0.0145, 0, 0.0),
                    )
                ],
                0.005,
                (0, 1, 0),
            ),
        )
        out = np.array([0, np.sign(y), 0])
        visual.add("dark", cylinder(arm + 0.002 * out, arm + 0.0055 * out, 0.0105, 12))
    _upper_arm_motors(visual)
    for site, base in (
        *(("delt_post_2", (0.002, 0.004, -0.085)), ("lat_dorsi_2", (0.002, 0.004, -0.052))),
        *(("pec_major_1", (0.002, 0.002, -0.020)), ("infraspin_1", (-0.010, -0.010, 0.006))),
    ):
        visual.post(site, base)
    visual.post("subscap_1", (0.006, 0.014, 0.006), (0.020, 0.034, 0.018))
    visual.post("delt_ant_2", (0.014, 0.005, -0.112))
    visual.post("delt_mid_2", (0.010, 0.012, -0.104))
    visual.eyelet("biceps_1", (-0.1, 0.05, -1), (0.004, 0.000, -0.106))
    visual.eyelet("triceps_1", (0.2, 0, -1), (0.005, 0.010, -0.222), (-0.040, 0.000, -0.226))
    return visual


def _upper_arm_motors(visual: Visual) -> None:
    """The motors of brachialis and middle deltoid, and a box with their drivers."""
    visual.motor("brachialis_0", (0.012, -0.016, -0.156), (0.009, -0.019, -0.096), 0.0115)
    visual.motor("delt_mid_2", (0.022, 0.026, -0.112), (0.016, 0.026, -0.172), 0.0115)
    for z in (-0.112, -0.146):
        visual.add(
            "metal",
            turned((0.0025, 0.005, z), unit(ELBOW), [(-0.006, 0.0145), (0.006, 0.0145)], 12),
        )
        visual.add("metal", box((0.012, 0.016, z - 0.006), (0.010, 0.010, 0.004), x=(0.7, 0.7, 0)))
        visual.add("metal", box((0.006, -0.008, z + 0.004), (0.006, 0.010, 0.004)))
    visual.add("dark", box((-0.0185, 0.004, -0.136), (0.0085, 0.0165, 0.040)))
    visual.add("blue", box((-0.0275, 0.004, -0.112), (0.0008, 0.0110, 0.006)))


def ulna() -> Visual:
    """The forearm's bone at the elbow, which does not turn."""
    visual = Visual("ulna")
    visual.add("dark", cylinder((0, -0.0095, 0), (0, 0.0095, 0), 0.0125, 12))
    shaft = [
        (0, 0, 0.0),
        (0.001, -0.001, -0.025),
        (0.004, -0.007, -0.10),
        (0.0085, -0.017, -0.235),
        (0.010, -0.020, -0.262),
    ]
    visual.add("bone", tube(shaft, [0.011, 0.0095, 0.0075, 0.007, 0.009]))
    visual.post(
        "triceps_2", (0.000, -0.002, -0.004), (-0.026, -0.005, 0.012), colour="bone", radius=0.0042
    )
    visual.post("biceps_2", (0.002, -0.002, -0.050))
    visual.post("brachialis_1", (0.002, -0.003, -0.030))
    visual.motor("pron_teres_0", (0.026, 0.034, -0.044), (0.010, 0.036, -0.010), 0.0085)
    visual.add("metal", tube([(0.002, -0.002, -0.036), (0.016, 0.032, -0.030)], 0.005, 6, "none"))
    visual.motor("supinator_0", (-0.046, -0.006, -0.060), (-0.040, 0.002, -0.022), 0.0085)
    visual.add("metal", tube([(0.001, -0.001, -0.042), (-0.040, 0.000, -0.042)], 0.005, 6, "none"))
    visual.post("supinator_distal_0", (0.006, -0.013, -0.186), (-0.030, 0.014, -0.186))
    visual.post("pron_quad_0", (0.009, -0.018, -0.240), (0.026, 0.002, -0.241))
    return visual


def radius() -> Visual:
    """The forearm's bone that turns with the hand, with four motors of the wrist."""
    visual = Visual("radius")
    shaft = [
        (0, 0, -0.006),
        (0.0045, -0.004, -0.035),
        (0.008, -0.010, -0.10),
        (0.0165, -0.022, -0.215),
        WRIST + vector(0, 0, 0.020),
    ]
    visual.add("bone", tube(shaft, [0.0085, 0.0075, 0.0075, 0.0085, 0.012]))
    visual.add("dark", cylinder((0, 0, -0.004), (0, 0, -0.014), 0.0105, 12))
    middle = np.array([0.0095, -0.012, 0.0])
    for name in ("ecr", "fcr", "ecu", "fcu"):
        site = visual.sites[f"{name}_0"]
        inner = middle + 0.66 * (site * (1, 1, 0) - middle)
        front = inner + vector(0, 0, site[2] - 0.006)
        visual.motor(f"{name}_0", front, front - vector(0, 0, 0.056), 0.0115)
        hub = middle + vector(0, 0, site[2] - 0.034)
        visual.add("metal", tube([hub, front - vector(0, 0, 0.028)], [0.006, 0.005], 6, "none"))
    visual.add(
        "metal",
        turned((0.0085, -0.0115, -0.140), (0.06, -0.09, 1), [(0, 0.0125), (0.045, 0.0125)], 10),
    )
    for site in ("pron_teres_1", "supinator_1", "pron_quad_1", "supinator_distal_1"):
        z = visual.sites[site][2]
        share = z / WRIST[2]
        visual.post(site, share * WRIST * (0.95, 0.95, 1.0))
    for x in (0.017, -0.017):  # the fork of the wrist
        visual.add("metal", box(WRIST + vector(x, 0, 0.008), (0.0025, 0.0085, 0.017)))
    visual.add("metal", box(WRIST + vector(0, 0, 0.022), (0.0195, 0.0085, 0.0035)))
    visual.add(
        "metal", cylinder(WRIST - vector(0.0185, 0, 0), WRIST + vector(0.0185, 0, 0), 0.005, 8)
    )
    return visual
