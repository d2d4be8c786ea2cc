"""Force offset: an actuator exerts an additional constant force.

The force limits of the actuator are shifted, too. If efforts are compared by inverse dynamics,
actuators are not replayed; the force then acts on a joint by a hook, because MuJoCo has no constant
joint force.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Values
from reality_gap.causes.support import actuators, elements, typical_scales
from reality_gap.causes.support.constant_force import constant_force
from reality_gap.causes.support.own_amounts import with_own_amounts
from reality_gap.study.system import System


def _locations(system: System) -> tuple[Location, ...]:
    if system.study.inverse:
        return elements.each_joint(system)
    return elements.each_actuator(system, actuators.is_linear)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    if location.kind == "actuator":
        unit, size = typical_scales.actuator_force(system, location)
    else:
        unit, size = typical_scales.joint_force(system, location)
    tolerance = typical_scales.force_tolerance(system, location)
    if location.kind == "actuator":
        tolerance *= typical_scales.OF_MOTOR
    return (Parameter("force", unit, 0.05 * size, tolerance, -2.0 * size, 2.0 * size),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if location.kind != "actuator" or not values["force"]:
        return
    for name in location.elements:
        actuator = spec.actuator(name)
        actuators.make_affine(actuator)
        actuator.biasprm[0] += values["force"]
        if np.any(actuator.forcerange):
            actuator.forcerange += values["force"]


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    if location.kind != "joint":
        return
    name = location.elements[0]
    effects.add_hook(lambda model: constant_force(model, "joint", name, values["force"]))


CAUSE = with_own_amounts(
    Cause(
        id="force_offset",
        title="force offset",
        explanation="A constant force acts in addition to the commanded one.",
        locations=_locations,
        parameters=_parameters,
        edit=_edit,
        attach=_attach,
    )
)
