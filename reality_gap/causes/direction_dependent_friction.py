"""Friction that depends on the direction of the motion: of a wire, or of a joint such as a screw's.

The size of the dry friction (and, of joints, of the viscous one) changes with the sign of the
velocity, over a velocity so low that the replay stays smooth. Forward is the way in which a wire
gets longer, or the joint's position grows. MuJoCo's frictions know no direction, so that a hook
writes them, from the velocity alone.
"""

from __future__ import annotations

import math

import mujoco

from reality_gap.cause import Cause, Effects, Hook, Parameter, Place, Values
from reality_gap.causes import places, sizes
from reality_gap.causes.coulomb_friction import SOLIMP, SOLREF
from reality_gap.causes.extra import Extra
from reality_gap.system import System

PERIOD = 0.004
"""Time between changes of the friction [s]."""

CREEP = 2e-3
"""Share of a typical velocity below which the direction is not clear."""


def _places(system: System) -> tuple[Place, ...]:
    return places.each_wire(system) + places.each_joint(system)


def _parameters(system: System, place: Place) -> tuple[Parameter, ...]:
    if place.kind == "tendon":
        return tuple(Parameter(way, "N", 3.0, 0.15, 0.0, 200.0) for way in ("forward", "backward"))
    unit, size = sizes.joint_force(system, place)
    dry = (unit, 0.02 * size, 0.0005 * size, 0.0, 2.0 * size)
    unit, size = sizes.joint_damping(system, place)
    viscous = (unit, 0.02 * size, 0.0005 * size, 0.0, 2.0 * size)
    return (
        Parameter("forward", *dry),
        Parameter("backward", *dry),
        Parameter("forward_viscous", *viscous),
        Parameter("backward_viscous", *viscous),
    )


def _attach(effects: Effects, system: System, place: Place, values: Values) -> None:
    add = _on_wire if place.kind == "tendon" else _on_joint
    effects.act(lambda model: add(model, system, place, values), period=PERIOD)


def _on_wire(model: mujoco.MjModel, system: System, place: Place, values: Values) -> Hook:
    wire = model.tendon(place.elements[0]).id
    friction = Extra(model.tendon_frictionloss, wire)
    model.tendon_solref_fri[wire], model.tendon_solimp_fri[wire] = SOLREF, SOLIMP
    creep = CREEP * sizes.WIRE_SPEED

    def hook(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        forward = _forward(data.ten_velocity[wire] / creep)
        friction.write(values["forward"] * forward + values["backward"] * (1 - forward))

    return hook


def _on_joint(model: mujoco.MjModel, system: System, place: Place, values: Values) -> Hook:
    dof = int(model.joint(place.elements[0]).dofadr[0])
    friction, damping = Extra(model.dof_frictionloss, dof), Extra(model.dof_damping, dof)
    model.dof_solref[dof], model.dof_solimp[dof] = SOLREF, SOLIMP
    creep = CREEP * sizes.joint_speed(system, place)

    def hook(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        forward = _forward(data.qvel[dof] / creep)
        backward = 1 - forward
        friction.write(values["forward"] * forward + values["backward"] * backward)
        damping.write(values["forward_viscous"] * forward + values["backward_viscous"] * backward)

    return hook


def _forward(velocity: float) -> float:
    """1 forward, 0 backward, and between where the velocity, over what is clear, is low."""
    return 0.5 * (1 + math.tanh(velocity))


CAUSE = Cause(
    id="direction_dependent_friction",
    title="friction that depends on the direction",
    explanation="Friction is larger in one direction of the motion than in the other.",
    places=_places,
    parameters=_parameters,
    attach=_attach,
)
