"""Tension offset: a tension sensor reads a constant too much."""

from __future__ import annotations

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support import elements, typical_scales
from reality_gap.study.system import System


def _locations(system: System) -> tuple[Location, ...]:
    return elements.each_tendon(system, sensed="tension")


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    size = typical_scales.tendon_force(system, location)
    return (Parameter("offset", "N", 0.05 * size, 0.002 * size, -2.0 * size, 2.0 * size),)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    signs = elements.tension_signs(system, location)

    def shift(record: Record) -> None:
        for sensor, sign in signs.items():
            record.sensors[:, record.column(sensor)] += sign * values["offset"]

    effects.readings.append(shift)


CAUSE = Cause(
    id="tension_offset",
    title="tension offset",
    explanation="A tension sensor reads a tension with a constant error.",
    locations=_locations,
    parameters=_parameters,
    attach=_attach,
)
