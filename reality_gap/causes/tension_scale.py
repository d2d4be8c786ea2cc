"""Tension scale: a tension sensor reads the tension times a constant factor."""

from __future__ import annotations

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support import elements
from reality_gap.study.system import System


def _locations(system: System) -> tuple[Location, ...]:
    return elements.each_tendon(system, sensed="tension") + elements.all_tendons(
        system, sensed="tension"
    )


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return (Parameter("scale", "1", 0.05, 0.003, -0.9, 2.0),)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    sensors = tuple(elements.tension_signs(system, location))

    def stretch(record: Record) -> None:
        for sensor in sensors:
            record.sensors[:, record.column(sensor)] *= 1.0 + values["scale"]

    effects.readings.append(stretch)


CAUSE = Cause(
    id="tension_scale",
    title="tension scale",
    explanation="A tension sensor reads the tension times a constant factor.",
    locations=_locations,
    parameters=_parameters,
    attach=_attach,
)
