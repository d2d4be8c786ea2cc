"""Coulomb friction of a wire in its guides, or of a joint."""

from __future__ import annotations

import mujoco

from reality_gap.cause import Cause, Parameter, Place, Values
from reality_gap.causes import places, sizes
from reality_gap.system import System

SOLREF = (0.004, 1.0)
SOLIMP = (0.99, 0.999, 0.001, 0.5, 2.0)
"""Friction that hardly creeps: MuJoCo's default lets a tenth of the force through at rest."""


def _places(system: System) -> tuple[Place, ...]:
    return places.each_wire(system) + places.all_wires(system) + places.each_joint(system)


def _parameters(system: System, place: Place) -> tuple[Parameter, ...]:
    if place.kind == "tendon":
        return (Parameter("friction", "N", 3.0, 0.15, 0.0, 200.0),)
    unit, size = sizes.joint_force(system, place)
    return (Parameter("friction", unit, 0.02 * size, 0.0005 * size, 0.0, 2.0 * size),)


def _edit(spec: mujoco.MjSpec, system: System, place: Place, values: Values) -> None:
    if not values["friction"]:
        return
    for name in place.elements:
        element = spec.tendon(name) if place.kind == "tendon" else spec.joint(name)
        element.frictionloss = element.frictionloss + values["friction"]
        element.solref_friction, element.solimp_friction = SOLREF, SOLIMP


CAUSE = Cause(
    id="coulomb_friction",
    title="Coulomb friction",
    explanation="A force of constant size opposes the motion, so that it sticks and lags behind.",
    places=_places,
    parameters=_parameters,
    edit=_edit,
)
