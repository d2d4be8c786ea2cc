"""Direction-dependent friction of a tendon or a joint, such as that of a screw.

Dry friction has the size ``F+`` forward, which is the direction in which a tendon becomes longer or
a joint's position increases, and ``F-`` backward. It is equivalent to dry friction of the mean size
plus a constant force,

    -F(v) = -(F+ + F-)/2 sign(v) - (F+ - F-)/2

in which form it is usually identified, for example in A. Janot, M. Gautier and M. Brunot, "Data Set
and Reference Models of EMPS", 2019. The viscous friction of joints may depend on the direction in
the same manner; a hook changes the damping with the sign of the velocity.
"""

from __future__ import annotations

import math

import mujoco

from reality_gap.causes.base import Cause, Effects, Hook, Location, Parameter, Values
from reality_gap.causes.support import elements, lugre, typical_scales
from reality_gap.causes.support.constant_force import constant_force
from reality_gap.causes.support.model_overrides import ModelOffset
from reality_gap.study.system import System

CREEP = 2e-3
"""Share of the typical velocity below which the direction is not clear."""


def _locations(system: System) -> tuple[Location, ...]:
    return elements.each_tendon(system) + elements.each_joint(system)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    presliding = lugre.presliding_parameters(system, location)
    if location.kind == "tendon":
        size = typical_scales.tendon_force(system, location)
        sizes = (0.03 * size, 0.001 * size, 0.0, 2.0 * size)
        names = ("forward", "backward")
        return tuple(Parameter(name, "N", *sizes) for name in names) + presliding
    unit, size = typical_scales.joint_force(system, location)
    most = typical_scales.most_friction(system, location)
    dry = (unit, 0.02 * size, typical_scales.force_tolerance(system, location), 0.0, most * size)
    unit, size = typical_scales.joint_damping(system, location)
    viscous = (unit, 0.02 * size, 0.001 * size, 0.0, most * size)
    return (
        Parameter("forward", *dry),
        Parameter("backward", *dry),
        Parameter("forward_viscous", *viscous),
        Parameter("backward_viscous", *viscous),
        *presliding,
    )


def _mean(values: Values, kind: str = "") -> float:
    return 0.5 * (values[f"forward{kind}"] + values[f"backward{kind}"])


def _half(values: Values, kind: str = "") -> float:
    return 0.5 * (values[f"forward{kind}"] - values[f"backward{kind}"])


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if _mean(values):
        constant = -_half(values) if lugre.is_available(system) else 0.0
        lugre.add_friction(spec, system, CAUSE.id, location, _mean(values), values, constant)
    if location.kind == "joint":
        spec.joint(location.elements[0]).damping[0] += _mean(values, "_viscous")


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    name = location.elements[0]
    if not lugre.is_available(system) and _half(values):
        effects.add_hook(lambda model: constant_force(model, location.kind, name, -_half(values)))
    if location.kind == "joint" and _half(values, "_viscous"):
        creep = CREEP * typical_scales.joint_speed(system, location)
        effects.add_hook(lambda model: _drag(model, name, creep, values), period=lugre.SPEED_PERIOD)


def _drag(model: mujoco.MjModel, joint: str, creep: float, values: Values) -> Hook:
    """Return a hook that changes a joint's damping with the direction of its velocity."""
    dof, half = int(model.joint(joint).dofadr[0]), _half(values, "_viscous")
    damping = ModelOffset(model.dof_damping, dof)

    def hook(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        damping.set(half * math.tanh(data.qvel[dof] / creep))

    return hook


CAUSE = Cause(
    id="direction_dependent_friction",
    title="direction-dependent friction",
    explanation="Friction is larger in one direction of the motion than in the other.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
    fine=True,
    sticky=True,
    includes=("coulomb_friction", "viscous_friction"),
)
