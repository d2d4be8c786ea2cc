"""Friction that depends on the direction of the motion: of a wire, or of a joint such as a screw's.

The size of the dry friction (and, of joints, of the viscous one) changes with the direction of the
motion. Forward is the way in which a wire gets longer, or the joint's position grows. Dry friction
of two sizes is their mean, and a constant force of half their difference: as such it is identified,
in EMPS for one (A. Janot, M. Gautier and M. Brunot, "Data Set and Reference Models of EMPS", 2019).
At rest it holds whatever lies between the two; what trembles is left with the constant force.
"""

from __future__ import annotations

import math

import mujoco

from reality_gap.causes.base import Cause, Effects, Hook, Location, Parameter, Values
from reality_gap.causes.support import elements, lugre, typical_scales
from reality_gap.causes.support.constant_force import push
from reality_gap.causes.support.model_overrides import Extra
from reality_gap.study.system import System

PERIOD = 0.004
"""Time between changes of the friction [s]."""

CREEP = 2e-3
"""Share of a typical velocity below which the direction is not clear."""


def _locations(system: System) -> tuple[Location, ...]:
    return elements.each_tendon(system) + elements.each_joint(system)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    bend = (lugre.bend(system, location),) if lugre.possible(system) else ()
    if location.kind == "tendon":
        ways = ("forward", "backward")
        return tuple(Parameter(way, "N", 3.0, 0.05, 0.0, 200.0) for way in ways) + bend
    unit, size = typical_scales.joint_force(system, location)
    dry = (unit, 0.02 * size, 0.0002 * size, 0.0, 2.0 * size)
    unit, size = typical_scales.joint_damping(system, location)
    viscous = (unit, 0.02 * size, 0.0002 * size, 0.0, 2.0 * size)
    return (
        Parameter("forward", *dry),
        Parameter("backward", *dry),
        Parameter("forward_viscous", *viscous),
        Parameter("backward_viscous", *viscous),
        *bend,
    )


def _mean(values: Values, kind: str = "") -> float:
    return 0.5 * (values[f"forward{kind}"] + values[f"backward{kind}"])


def _half(values: Values, kind: str = "") -> float:
    return 0.5 * (values[f"forward{kind}"] - values[f"backward{kind}"])


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if _mean(values):
        lean = -_half(values) if lugre.possible(system) else 0.0
        bend = lugre.bend_in(values, system, location)
        lugre.brake(spec, system, CAUSE.id, location, _mean(values), bend, lean)
    if location.kind == "joint":
        spec.joint(location.elements[0]).damping[0] += _mean(values, "_viscous")


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    name = location.elements[0]
    if not lugre.possible(system) and _half(values):
        effects.act(lambda model: push(model, location.kind, name, -_half(values)))
    if location.kind == "joint" and _half(values, "_viscous"):
        creep = CREEP * typical_scales.joint_speed(system, location)
        effects.act(lambda model: _drag(model, name, creep, values), period=PERIOD)


def _drag(model: mujoco.MjModel, joint: str, creep: float, values: Values) -> Hook:
    """What the direction changes of a joint's viscous friction."""
    dof, half = int(model.joint(joint).dofadr[0]), _half(values, "_viscous")
    damping = Extra(model.dof_damping, dof)

    def hook(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        damping.write(half * math.tanh(data.qvel[dof] / creep))

    return hook


CAUSE = Cause(
    id="direction_dependent_friction",
    title="friction that depends on the direction",
    explanation="Friction is larger in one direction of the motion than in the other.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
    fine=True,
    sticky=True,
)
