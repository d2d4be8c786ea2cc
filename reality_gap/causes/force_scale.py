"""Force scale: the force of an actuator is too large or too small by a constant factor.

It is one of a motor or servo, or a muscle, whose peak force is then another.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Location, Parameter, Values
from reality_gap.causes.support import actuators, elements, joint_motors
from reality_gap.study.system import System

OF_JOINT, OF_TENDON = 0.006, 0.004
"""Relative standard deviations of the forces of motors of joints and of tendons."""


def _locations(system: System) -> tuple[Location, ...]:
    found = elements.each_actuator(system, _has_scale)
    return found + elements.all_actuators(system, _has_scale)


def _has_scale(model: mujoco.MjModel, actuator: int) -> bool:
    return actuators.is_linear(model, actuator) or actuators.is_muscle(model, actuator)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    of_joint = joint_motors.is_motor(system.model, system.model.actuator(location.elements[0]).id)
    tolerance = OF_JOINT if of_joint else OF_TENDON
    return (Parameter("excess", "1", 0.05, tolerance, -0.9, 2.0),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    for name in location.elements:
        actuators.scale_force(spec.actuator(name), 1.0 + values["excess"])


CAUSE = Cause(
    id="force_scale",
    title="force scale",
    explanation="The force of an actuator is too large or too small by a constant factor.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
)
