"""Stribeck friction of a joint: dry friction that a joint has at rest and loses as it moves.

Lubricated gears and bearings stick harder than they slide. The friction in addition to that which
does not depend on the speed ``v`` (see Coulomb friction) is

    F(v) = stiction exp(-(v / speed)^2)

Source: B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, "A survey of models, analysis tools
and compensation methods for the control of machines with friction", Automatica 30 (1994).
"""

from __future__ import annotations

import math

import mujoco

from reality_gap.causes.base import Cause, Effects, Hook, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import elements, lugre, typical_scales
from reality_gap.study.system import System

SECANTS = (0.1, 0.4)
"""Sizes at which the cause is screened in addition to a small one, over the joint's force."""
SLOW = (0.25, 0.06)
"""Stribeck velocities from which fits start, over the typical velocity of a joint."""
ODDS = -1.0
"""Log odds of Stribeck friction [nats]: Coulomb friction, which is much more usual, does nearly the
same in a slow motion."""


def _locations(system: System) -> tuple[Location, ...]:
    return elements.each_joint(system)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    unit, size = typical_scales.joint_force(system, location)
    tolerance = typical_scales.force_tolerance(system, location)
    speed = typical_scales.joint_speed(system, location)
    starts = tuple(share * speed for share in SLOW)
    per = "m/s" if typical_scales.slides(system, location.elements[0]) else "rad/s"
    secants = elements.secants(system, location, tuple(share * size for share in SECANTS))
    most = typical_scales.most_friction(system, location)
    hints, sizes = SearchHints(secants=secants), (0.02 * size, tolerance, 0.0, most * size)
    speeds = (0.05 * speed, 0.0, 0.005 * speed, speed)
    return (
        Parameter("stiction", unit, *sizes, hints=hints),
        Parameter("speed", per, *speeds, null=starts[0], hints=SearchHints(starts)),
        *lugre.presliding_parameters(system, location),
    )


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if values["stiction"]:
        lugre.add_friction(spec, system, CAUSE.id, location, values["stiction"], values)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    stiction, speed = values["stiction"], values["speed"]
    if not stiction:
        return

    def make(model: mujoco.MjModel) -> Hook:
        friction = lugre.VariableFriction(model, system, CAUSE.id, location)
        dof = int(model.joint(location.elements[0]).dofadr[0])

        def hook(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            friction.scale(stiction, math.exp(-((data.qvel[dof] / speed) ** 2)))

        return hook

    effects.add_hook(make, period=lugre.SPEED_PERIOD)


def _prior(location: Location) -> float:
    return ODDS


CAUSE = Cause(
    id="stribeck_friction",
    title="Stribeck friction",
    explanation="A joint sticks harder than it slides: dry friction falls as it begins to move.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
    fine=True,
    sticky=True,
    prior=_prior,
)
