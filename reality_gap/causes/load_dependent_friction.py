"""Load-dependent friction: friction of a tendon that grows with its tension ``T``.

In guides, the friction is ``mu T``. Around bends, it is capstan friction: with the sum ``phi`` of
all bend angles, the capstan equation gives ``T (exp(mu phi) - 1)`` while the tendon becomes longer
against its motor, and ``T (1 - exp(-mu phi))`` while it becomes shorter. Both are

    T (sinh(mu phi) + s (cosh(mu phi) - 1)),    s = 1 lengthening, s = -1 shortening

No element of MuJoCo depends on a tension. The model therefore gets the friction at a typical
tension, and a hook scales it during the replay.
"""

from __future__ import annotations

import math
from itertools import pairwise

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Hook, Location, Parameter, Values
from reality_gap.causes.support import elements, lugre, typical_scales
from reality_gap.study.system import System
from reality_gap.types import Floats

CAPSTAN = "capstan"
"""Note of a location with friction around bends."""

ANGLE_PERIOD = 0.01
"""Time between computations of the bend angles [s]."""

PULLEY = -2
"""Value of ``wrap_obj`` of a point on a pulley."""

TOUCHING = 1e-9
"""Distance below which two points of a path are one [m]."""

CREEP = 0.01
"""Velocity from which on the direction of a tendon's motion is clear, over its typical velocity."""


def _locations(system: System) -> tuple[Location, ...]:
    straight = elements.each_tendon(system) + elements.all_tendons(system)
    bent = {w.name for w in system.tendons if _bends(system.model, w.name)}
    capstan = [Location(p.kind, p.elements, CAPSTAN) for p in straight if bent & set(p.elements)]
    return straight + tuple(capstan)


def _bends(model: mujoco.MjModel, tendon: str) -> bool:
    """Return whether a spatial tendon has more than two points in its path."""
    here = model.tendon(tendon).id
    start, count = int(model.tendon_adr[here]), int(model.tendon_num[here])
    joint = int(mujoco.mjtWrap.mjWRAP_JOINT)
    return count > 2 and int(model.wrap_type[start]) != joint


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    scale = 0.1 if location.note == CAPSTAN else 0.05
    coefficient = Parameter("coefficient", "1", scale, 0.01 * scale, 0.0, 1.0)
    return (coefficient, *lugre.presliding_parameters(system, location))


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if values["coefficient"]:
        usual = values["coefficient"] * typical_scales.tendon_force(system, location)
        lugre.add_friction(spec, system, CAUSE.id, location, usual, values)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    names = tuple(system.tendon(name).actuator for name in location.elements)
    mu, usual = values["coefficient"], typical_scales.tendon_force(system, location)
    if not mu:
        return
    creep = CREEP * typical_scales.tendon_speed(system)

    def make(model: mujoco.MjModel) -> Hook:
        tendons = np.array([model.tendon(name).id for name in location.elements])
        actuators = np.array([model.actuator(name).id for name in names])
        friction = lugre.VariableFriction(model, system, CAUSE.id, location)
        gear = model.actuator_gear[actuators, 0]
        bends = _Bends(tendons) if location.note == CAPSTAN else None

        def hook(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            tension = np.maximum(-gear * data.actuator_force[actuators], 0.0)
            if bends is None:
                friction.scale(mu * usual, tension / usual)
                return
            angle = mu * bends.angle(data)
            outward = friction.directions(data, data.ten_velocity[tendons], creep)
            share = np.sinh(angle) + outward * (np.cosh(angle) - 1)
            friction.scale(mu * usual, share * tension / (mu * usual))

        return hook

    effects.add_hook(make, period=lugre.LOAD_PERIOD)


class _Bends:
    """Bend angles of tendons, recomputed each `ANGLE_PERIOD`."""

    def __init__(self, tendons: Floats) -> None:
        self._tendons = tendons
        self._time = -np.inf
        self._angle = np.zeros(len(tendons))

    def angle(self, data: mujoco.MjData) -> Floats:
        """Return the sum of the bend angles of each tendon, shape (n,) [rad]."""
        if data.time > self._time + ANGLE_PERIOD - 1e-6:
            self._time = data.time
            self._angle = np.array([total_bend(data, int(i)) for i in self._tendons])
        return self._angle


def total_bend(data: mujoco.MjData, tendon: int) -> float:
    """Return the sum of the angles between the straight segments of a tendon's path [rad].

    The two points where a tendon touches a geom are connected by a chord. At each of them the path
    bends by half the wrap angle, so that the sum is the wrap angle.

    Args:
        data: state after ``mj_fwdPosition``.
        tendon: id of the tendon.
    """
    start, count = int(data.ten_wrapadr[tendon]), int(data.ten_wrapnum[tendon])
    points = data.wrap_xpos.reshape(-1, 3)[start : start + count].tolist()
    wrapped = data.wrap_obj.ravel()[start : start + count].tolist()
    total, before = 0.0, None
    # With few points, floats are faster than arrays.
    for (here, one), (there, other) in pairwise(zip(points, wrapped, strict=True)):
        if PULLEY in (one, other):
            before = None
            continue
        length = math.dist(here, there)
        if length < TOUCHING:
            continue
        unit = [(b - a) / length for a, b in zip(here, there, strict=True)]
        if before is not None:
            cosine = sum(a * b for a, b in zip(before, unit, strict=True))
            total += math.acos(min(1.0, max(-1.0, cosine)))
        before = unit
    return total


CAUSE = Cause(
    id="load_dependent_friction",
    title="friction that grows with tension",
    explanation="A tendon's friction grows with its tension, in its guides or around its bends.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
    fine=True,
    sticky=True,
)
