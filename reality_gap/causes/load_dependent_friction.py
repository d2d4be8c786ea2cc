"""Friction of a wire that grows with its tension, with and without its wrap angle.

In its guides a wire loses ``mu T``. Over what it bends around, capstan's law: pulled against its
motor by ``T (exp(mu phi) - 1)``, let go by ``T (1 - exp(-mu phi))``, phi being all its bends
together. Nothing in MuJoCo depends on a tension: the model gets the friction of a usual one, and a
hook adds what is missing.
"""

from __future__ import annotations

import math
from itertools import pairwise

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Hook, Location, Parameter, Values
from reality_gap.causes.support import elements, lugre
from reality_gap.study.system import System
from reality_gap.types import Floats

CAPSTAN = "capstan"

PERIOD = 0.006
"""Time between changes of the friction [s]."""

ANGLE_PERIOD = 0.01
"""How often bends are measured [s]; they change as slowly as the posture."""

USUAL = 100.0
"""Tension that a wire has when it works [N], about."""

PULLEY = -2
"""What ``wrap_obj`` says of a point on a pulley."""

TOUCHING = 1e-9
"""Distance under which two points of a path are one [m]."""

CREEP = 1e-3
"""Velocity at which the direction of a wire's motion counts as clear [m/s]."""


def _locations(system: System) -> tuple[Location, ...]:
    straight = elements.each_tendon(system) + elements.all_tendons(system)
    bent = {w.name for w in system.tendons if _bends(system.model, w.name)}
    capstan = [Location(p.kind, p.elements, CAPSTAN) for p in straight if bent & set(p.elements)]
    return straight + tuple(capstan)


def _bends(model: mujoco.MjModel, tendon: str) -> bool:
    """Whether the path of a spatial tendon has more than two points."""
    here = model.tendon(tendon).id
    start, count = int(model.tendon_adr[here]), int(model.tendon_num[here])
    joint = int(mujoco.mjtWrap.mjWRAP_JOINT)
    return count > 2 and int(model.wrap_type[start]) != joint


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    scale = 0.1 if location.note == CAPSTAN else 0.05
    coefficient = Parameter("coefficient", "1", scale, 0.01 * scale, 0.0, 1.0)
    if not lugre.possible(system):
        return (coefficient,)
    return (coefficient, lugre.bend(system, location))


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if values["coefficient"]:
        usual, bend = values["coefficient"] * USUAL, lugre.bend_in(values, system, location)
        lugre.brake(spec, system, CAUSE.id, location, usual, bend)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    names = tuple(system.tendon(name).actuator for name in location.elements)
    mu = values["coefficient"]
    if not mu:
        return

    def make(model: mujoco.MjModel) -> Hook:
        tendons = np.array([model.tendon(name).id for name in location.elements])
        actuators = np.array([model.actuator(name).id for name in names])
        friction = lugre.Brakes(model, system, CAUSE.id, location)
        gear = model.actuator_gear[actuators, 0]
        bends = _Bends(tendons) if location.note == CAPSTAN else None

        def hook(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            tension = np.maximum(-gear * data.actuator_force[actuators], 0.0)
            if bends is None:
                friction.press(mu * USUAL, tension / USUAL)
                return
            angle = mu * bends.angle(data)
            outward = friction.ways(data, data.ten_velocity[tendons], CREEP)
            share = np.sinh(angle) + outward * (np.cosh(angle) - 1)
            friction.press(mu * USUAL, share * tension / (mu * USUAL))

        return hook

    effects.act(make, period=PERIOD)


class _Bends:
    """The bends of wires, measured now and then."""

    def __init__(self, tendons: Floats) -> None:
        self._tendons = tendons
        self._time = -np.inf
        self._angle = np.zeros(len(tendons))

    def angle(self, data: mujoco.MjData) -> Floats:
        """Sum of the bends of each wire (n,) [rad]."""
        if data.time > self._time + ANGLE_PERIOD - 1e-6:
            self._time = data.time
            self._angle = np.array([total_bend(data, int(i)) for i in self._tendons])
        return self._angle


def total_bend(data: mujoco.MjData, tendon: int) -> float:
    """Sum of the angles between the straight pieces of a tendon's path [rad].

    Between the two points where it touches a geom, the chord bends by half the angle of wrap at
    either end, so that the sum is the angle of wrap.
    """
    start, count = int(data.ten_wrapadr[tendon]), int(data.ten_wrapnum[tendon])
    points = data.wrap_xpos.reshape(-1, 3)[start : start + count].tolist()
    wrapped = data.wrap_obj.ravel()[start : start + count].tolist()
    total, before = 0.0, None
    # Plain numbers: a path has few points, and is looked at thousands of times in a replay.
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
    explanation="A wire's friction grows with its tension, in its guides or around its bends.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
    fine=True,
    sticky=True,
)
