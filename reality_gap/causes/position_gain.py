"""Position gain: the gain kp of a position servo differs from that of the model.

The servo exerts ``kp (command - position) - kd velocity``. A firmware counts kp in its own unit, so
that a conversion factor is wrong for one servo, or for all of a kind.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import drives, elements, joint_motors
from reality_gap.study.system import System

SECANTS = (-0.5, -0.9, -0.98)
"""Relative errors at which the cause is screened in addition to a small one."""
ODDS = -2.0
"""Log odds at tendons [nats]: the scale of the force does nearly the same there."""


def _locations(system: System) -> tuple[Location, ...]:
    return drives.each_and_all(system, _has_own_gain)


def _has_own_gain(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether kp is not the scale of all the force, as that of a tendon without kd is."""
    at_joint = joint_motors.is_motor(model, actuator) and drives.is_servo(model, actuator)
    return at_joint or drives.is_damped(model, actuator)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    hints = SearchHints(secants=elements.secants(system, location, SECANTS), absence=True)
    return (Parameter("excess", "1", 0.1, 0.006, -0.9995, 999.0, hints=hints),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    for name in location.elements:
        actuator = spec.actuator(name)
        actuator.gainprm[0] *= 1 + values["excess"]
        actuator.biasprm[1] *= 1 + values["excess"]


def _prior(location: Location) -> float:
    return ODDS if location.note == drives.OF_TENDON else 0.0


CAUSE = Cause(
    id="position_gain",
    title="wrong position gain",
    explanation="The position gain (kp) of a servo is too large or too small by a constant factor.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    prior=_prior,
)
