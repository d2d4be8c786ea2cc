"""Force scale: the force of an actuator is too large or too small by a constant factor."""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Location, Parameter, Values
from reality_gap.causes.support import actuators, elements
from reality_gap.study.system import System


def _locations(system: System) -> tuple[Location, ...]:
    found = elements.each_actuator(system, actuators.is_linear)
    return found + elements.all_actuators(system, actuators.is_linear)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return (Parameter("excess", "1", 0.05, 0.002, -0.9, 2.0),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    for name in location.elements:
        actuator = spec.actuator(name)
        actuator.gainprm[:3] *= 1 + values["excess"]
        actuator.biasprm[:3] *= 1 + values["excess"]
        actuator.forcerange *= 1 + values["excess"]


CAUSE = Cause(
    id="force_scale",
    title="force scale",
    explanation="The force of an actuator is too large or too small by a constant factor.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
)
