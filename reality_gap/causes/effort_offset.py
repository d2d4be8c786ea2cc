"""Effort offset: the measured force or torque of a motor has a constant error.

Where efforts are compared by inverse dynamics, a constant force on the joint does the same; see
`reality_gap.causes.force_offset`.
"""

from __future__ import annotations

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support import efforts
from reality_gap.study.system import System


def _locations(system: System) -> tuple[Location, ...]:
    return () if system.study.inverse else efforts.each(system)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    unit, size = efforts.typical(system, location.elements[0])
    tolerance = efforts.tolerance(system, location.elements[0])
    return (Parameter("offset", unit, 0.05 * size, tolerance, -2.0 * size, 2.0 * size),)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    def shift(record: Record) -> None:
        for sensor in location.elements:
            record.sensors[:, record.column(sensor)] += values["offset"]

    effects.readings.append(shift)


CAUSE = Cause(
    id="effort_offset",
    title="offset of a measured force",
    explanation="The force of a motor is measured with a constant error.",
    locations=_locations,
    parameters=_parameters,
    attach=_attach,
)
