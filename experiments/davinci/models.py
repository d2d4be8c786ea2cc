"""Structures of a cable drive: models of its torque and jaw angle from drive angle and load.

All are special cases of one model. The spindle has Coulomb friction in its bearing, with a
stiffness before it slips, a spring, and an elastic cable. The cable has friction along its path: it
slides towards the spindle when it pulls with more than ``load e^a`` and back when it pulls with
less than ``load e^-a`` (capstan), or with ``load (1 +- mu)``, plus a constant. The jaw has a
compliance of its own under the load. Only the viscous term depends on the rate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from experiments.davinci.log import Runs
from jmm_agent.types import Floats

START: dict[str, float] = {
    "gear": 1.0,
    "torque_offset": 0.0,
    "kinematic_gear": 0.95,
    "jaw_offset": 1.2,
    "coulomb": 0.04,
    "viscous": 0.0,
    "capstan": 0.3,
    "load_friction": 0.3,
    "joint_stiffness": 0.02,
    "cable_stiffness": 1.5,
    "hardening": 2.0,
    "gap": 0.02,
    "drive_stiffness": 12.0,
    "drive_share": 0.7,
    "jaw_compliance": 0.5,
}
"""Where fits start, in the units of `UNITS`."""

UNITS: dict[str, str] = {
    "gear": "1",
    "torque_offset": "N m",
    "kinematic_gear": "1",
    "jaw_offset": "rad",
    "coulomb": "N m",
    "viscous": "N m s/rad",
    "capstan": "1",
    "load_friction": "1",
    "joint_stiffness": "N m/rad",
    "cable_stiffness": "N m/rad",
    "hardening": "N m/rad^2",
    "gap": "rad",
    "drive_stiffness": "N m/rad",
    "drive_share": "1",
    "jaw_compliance": "rad/(N m)",
}

CENTRE = -0.5
"""Rest angle of the spring at the spindle [rad]; equivalent to an offset of the torque."""

RIGID = 1e3
"""Stiffness of rigid elements [N m/rad]."""


@dataclass(frozen=True)
class Structure:
    """A hypothesis: its title and the names of its parameters."""

    title: str
    parameters: tuple[str, ...]

    def start(self) -> Floats:
        """Start of its fit, shape (p,)."""
        return np.array([START[name] for name in self.parameters])


BASE = ("gear", "torque_offset", "kinematic_gear", "jaw_offset")
WHOLE = (
    *BASE,
    "coulomb",
    "capstan",
    "joint_stiffness",
    "cable_stiffness",
    "drive_stiffness",
    "drive_share",
    "jaw_compliance",
    "hardening",
)

LADDER: dict[str, Structure] = {
    "rigid": Structure("rigid", BASE),
    "coulomb": Structure("+ Coulomb friction", WHOLE[:5]),
    "capstan": Structure("+ friction that grows with the load", WHOLE[:6]),
    "spring": Structure("+ spring at the spindle", WHOLE[:7]),
    "elastic": Structure("+ elastic cable", WHOLE[:8]),
    "drive": Structure("+ part of the friction before the cable", WHOLE[:10]),
    "jaw": Structure("+ compliance of the jaw under its load", WHOLE[:11]),
    "whole": Structure("+ cable that hardens: the whole", WHOLE),
}
"""Structures, each with one element more than the one before."""


def _without(*names: str) -> tuple[str, ...]:
    return tuple(name for name in WHOLE if name not in names)


ABLATIONS: dict[str, Structure] = {
    "friction that grows with the load": Structure(
        "whole, without friction by load", _without("capstan")
    ),
    "a spring at the spindle": Structure("whole, without spring", _without("joint_stiffness")),
    "an elastic cable": Structure("whole, rigid cable", _without("cable_stiffness", "hardening")),
    "friction before the cable": Structure(
        "whole, all friction on the cable", _without("drive_stiffness", "drive_share")
    ),
    "compliance behind the friction": Structure("whole, rigid jaw", _without("jaw_compliance")),
    "a cable that hardens": Structure("whole, linear cable", _without("hardening")),
}
"""The whole without one element, by the claim about that element."""

ALTERNATIVES: dict[str, Structure] = {
    "viscous": Structure("whole, with viscous friction", (*WHOLE, "viscous")),
    "backlash": Structure("backlash and linear cable", (*_without("hardening"), "gap")),
    "linear": Structure(
        "friction proportional to the load instead of capstan",
        (*_without("capstan"), "load_friction"),
    ),
}
"""Alternatives to the whole."""


def predict(structure: Structure, values: Floats, runs: Runs) -> tuple[Floats, Floats]:
    """Simulate a structure.

    Args:
        structure: of the drive.
        values: its parameters, shape (p,).
        runs: of which drive angle, load and the first torque are used.

    Returns:
        Torque of the spindle, shape (n, r) [N m], and angle of the jaw, shape (n, r) [rad].
    """
    p = dict(zip(structure.parameters, values, strict=True))
    share = p.get("drive_share", 0.0)
    coulomb = p.get("coulomb", 0.0)
    own = np.full(runs.drive.shape, share * coulomb)
    bearing = play(runs.drive, p.get("drive_stiffness", RIGID), own, -own, np.zeros(len(runs.load)))
    low, high = slides(p, runs.resistance, (1.0 - share) * coulomb)
    cable, slid = elastic(p, runs, low, high)
    torque = p["torque_offset"] + bearing + cable
    torque += p.get("joint_stiffness", 0.0) * (runs.drive - CENTRE)
    if "viscous" in p:
        torque += p["viscous"] * np.gradient(runs.drive, runs.time, axis=0)
    jaw = p["jaw_offset"] + p["kinematic_gear"] * slid
    return torque, jaw - p.get("jaw_compliance", 0.0) * runs.resistance


def slides(p: Mapping[str, float], resistance: Floats, constant: float) -> tuple[Floats, Floats]:
    """Torques at the drive end of the cable between which it sticks, shape (n, r) each [N m]."""
    load = p["gear"] * resistance
    if "load_friction" in p:
        return load * (1 - p["load_friction"]) - constant, load * (
            1 + p["load_friction"]
        ) + constant
    grip = np.exp(p.get("capstan", 0.0))
    return load / grip - constant, load * grip + constant


def elastic(p: Mapping[str, float], runs: Runs, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Torque of the cable at the drive, and drive angle minus elongation, shape (n, r) each."""
    k, hard, gap = p.get("cable_stiffness", RIGID), p.get("hardening", 0.0), p.get("gap", 0.0)

    def stretch(torque: Floats) -> Floats:
        size = np.abs(torque)
        if hard > 1e-9:
            return np.sign(torque) * (np.sqrt(k**2 + 4 * hard * size) - k) / (2 * hard)
        return torque / k + 0.5 * gap * np.sign(torque)

    first = np.clip(runs.torque[0], low[0], high[0])
    elongation = play(runs.drive, 1.0, stretch(high), stretch(low), stretch(first))
    taut = elongation - np.clip(elongation, -0.5 * gap, 0.5 * gap)
    return k * taut + hard * taut * np.abs(taut), runs.drive - elongation


def play(angle: Floats, stiffness: float, high: Floats, low: Floats, first: Floats) -> Floats:
    """Force of a spring in series with a slider, shape (n, r): play operator with two bounds.

    Args:
        angle: input, shape (n, r).
        stiffness: of the spring.
        high: upper bound of the force, shape (n, r).
        low: lower bound.
        first: force at the start, shape (r,).
    """
    out = np.empty_like(angle)
    state = np.clip(first, np.minimum(low[0], high[0]), high[0])
    move = stiffness * np.diff(angle, axis=0, prepend=angle[:1])
    for i in range(len(angle)):
        state = np.minimum(np.maximum(state + move[i], low[i]), high[i])
        out[i] = state
    return out
