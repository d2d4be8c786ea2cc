"""Velocity gain: the gain kd of a position servo differs from that of the model.

A servo without a velocity gain has no such location: viscous friction of its joint or tendon then
does the same.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Location, Parameter, Values
from reality_gap.causes.support import drives
from reality_gap.causes.support.shared_amounts import REDUCIBLE
from reality_gap.study.system import System


def _locations(system: System) -> tuple[Location, ...]:
    return drives.each_and_all(system, drives.is_damped)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return (Parameter("excess", "1", 0.1, 0.012, -1.0, 999.0, hints=REDUCIBLE),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    for name in location.elements:
        actuator = spec.actuator(name)
        actuator.biasprm[2] *= 1 + values["excess"]


CAUSE = Cause(
    id="velocity_gain",
    title="wrong velocity gain",
    explanation="The velocity gain (kd) of a servo is too large or too small by a constant factor.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
)
