"""Tension offset: a tension sensor reads a constant too much."""

from __future__ import annotations

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support import elements
from reality_gap.study.system import System


def _locations(system: System) -> tuple[Location, ...]:
    return elements.each_tendon(system, sensed="tension")


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return (Parameter("offset", "N", 5.0, 0.2, -200.0, 200.0),)


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
