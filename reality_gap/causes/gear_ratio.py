"""Gear ratio: a servo moves its joint by another amount than the model's gear says.

The servo obeys its command at the motor, whose encoder turns ``g (1 + excess)`` times as far as the
joint, with the ratio ``g`` of the model; its force on the joint is larger by as much. A reading of
the joint itself, such as that of a linear scale beside a ball screw, is right. Where the reading of
the joint is computed from that of the motor, the ratio is a scale of the encoder
(`encoder_scale`). Its tolerance is small, for teeth are counted.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Location, Parameter, Values
from reality_gap.causes.support import joint_motors
from reality_gap.study.system import System

ODDS = -1.0
"""Log odds [nats]: the gain of a command does nearly the same."""


def _locations(system: System) -> tuple[Location, ...]:
    return joint_motors.each_and_all(system, joint_motors.is_servo)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return (Parameter("excess", "1", 0.02, 0.0001, -0.9, 9.0),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    for name in location.elements:
        spec.actuator(name).gear[0] *= 1 + values["excess"]


def _prior(location: Location) -> float:
    return ODDS


CAUSE = Cause(
    id="gear_ratio",
    title="wrong gear ratio",
    explanation="A servo turns more or less often for the motion of its joint than in the model.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    prior=_prior,
)
