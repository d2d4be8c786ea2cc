"""Force limit: the largest force or torque of a joint's motor differs from that of the model.

A limit has no effect until the motor reaches it, so that its slope at the nominal value tells
nothing; it is screened at several sizes. A motor without a limit in the model has a nominal limit
here that it never reaches.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import joint_motors, typical_scales
from reality_gap.causes.support.force_limits import nominal_limit
from reality_gap.study.system import System

UNREACHED = 20.0
"""Limit that a motor without a limit never reaches, over its typical force."""
SHARES = (1.5, 0.7, 0.4, 0.2)
"""Limits at which the cause is screened, over the nominal limit."""
TYPICAL = (3.0, 1.0, 0.4, 0.15)
"""Limits at which motors without a limit are screened, over their typical force."""


def _locations(system: System) -> tuple[Location, ...]:
    return tuple(
        location
        for location in joint_motors.each_and_all(system, joint_motors.is_motor)
        if len(location.elements) == 1 or all(nominal_limit(system, n) for n in location.elements)
    )


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    if len(location.elements) > 1:
        hints = SearchHints(secants=tuple(share - 1.0 for share in SHARES))
        return (Parameter("excess", "1", -0.1, 0.003, -0.98, 9.0, hints=hints),)
    unit, size = typical_scales.actuator_force(system, location)
    limit = nominal_limit(system, location.elements[0])
    if limit:
        null, scale, tolerance, high = limit, 0.1 * limit, 0.003 * limit, 10.0 * limit
        values = tuple(share * limit for share in SHARES)
    else:
        null, scale, tolerance, high = UNREACHED * size, 5.0 * size, 0.0, UNREACHED * size
        values = tuple(share * size for share in TYPICAL)
    low = 0.1 * min(values)
    hints = SearchHints(secants=values)
    return (Parameter("limit", unit, -scale, tolerance, low, high, null, hints),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    for name in location.elements:
        limit = nominal_limit(system, name)
        new = limit * (1 + values["excess"]) if "excess" in values else values["limit"]
        actuator = spec.actuator(name)
        joint = system.model.joint(int(system.model.actuator(name).trnid[0]))
        if limit and system.model.jnt_actfrclimited[joint.id]:
            range_ = system.model.jnt_actfrcrange[joint.id]
            widest = new * abs(float(system.model.actuator(name).gear[0]))
            spec.joint(joint.name).actfrcrange = range_ * (widest / float(np.max(np.abs(range_))))
        if limit and system.model.actuator(name).forcelimited[0]:
            actuator.forcerange = actuator.forcerange * (new / limit)
        elif new < (limit or _parameters(system, location)[0].null):
            actuator.forcelimited, actuator.forcerange = 1, np.array([-new, new])


CAUSE = Cause(
    id="force_limit",
    title="limit of a motor's force",
    explanation="The largest force or torque of a motor is another than in the model.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
)
