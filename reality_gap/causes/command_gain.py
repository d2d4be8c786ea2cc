"""Command gain: a position servo obeys its command times a constant factor.

The factor acts about a command of 0, as with a wrong number of encoder counts per turn in the
firmware. Its tolerance is small, for a good model has the right number.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Location, Parameter, Values
from reality_gap.causes.support import joint_motors
from reality_gap.study.system import System


def _locations(system: System) -> tuple[Location, ...]:
    return joint_motors.each_and_all(system, joint_motors.is_servo)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return (Parameter("excess", "1", 0.02, 0.0001, -0.9, 2.0),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    for name in location.elements:
        spec.actuator(name).gainprm[0] *= 1 + values["excess"]


CAUSE = Cause(
    id="command_gain",
    title="wrong command gain",
    explanation="A servo goes to its command times a constant factor.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
)
