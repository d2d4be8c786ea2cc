"""Effort scale: the measured force or torque of a motor is wrong by a constant factor.

Efforts are often computed from the current of a motor with its torque constant and gear ratio.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support import efforts
from reality_gap.study.system import System
from reality_gap.types import Floats


def _locations(system: System) -> tuple[Location, ...]:
    return efforts.each_and_all(system)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return (Parameter("scale", "1", 0.05, 0.003, -0.9, 4.0),)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    def stretch(record: Record) -> None:
        for sensor in location.elements:
            record.sensors[:, record.column(sensor)] *= 1.0 + values["scale"]

    def stretch_effort(model: mujoco.MjModel, time: Floats, effort: Floats) -> None:
        for joint in location.elements:
            effort[:, model.joint(joint).dofadr[0]] *= 1.0 + values["scale"]

    if location.kind == "joint":
        effects.efforts.append(stretch_effort)
    else:
        effects.readings.append(stretch)


CAUSE = Cause(
    id="effort_scale",
    title="scale of a measured force",
    explanation="The force of a motor is measured times a constant factor.",
    locations=_locations,
    parameters=_parameters,
    attach=_attach,
)
