"""A camera whose focal length is not what was used to find poses in its pictures.

A marker of known size looks larger by as much, and is found nearer or farther; where it is in the
picture, times that distance over the focal length, stays. So depth alone is wrong, by a factor.
MuJoCo's cameras look along -z.
"""

from __future__ import annotations

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support import frames
from reality_gap.study.system import System

DEPTH = 2
"""Component of a position in a camera's frame."""


def _locations(system: System) -> tuple[Location, ...]:
    return frames.cameras(system, frames.position_sensors(system))


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return (Parameter("scale", "1", 0.02, 0.0005, -0.5, 1.0),)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    sensors = [
        s
        for s in frames.position_sensors(system)
        if frames.seen_from(system, s) == location.elements[0]
    ]

    def stretch(record: Record) -> None:
        for sensor in sensors:
            record.sensors[:, record.column(sensor, DEPTH)] *= 1.0 + values["scale"]

    effects.readings.append(stretch)


CAUSE = Cause(
    id="camera_focal",
    title="wrong focal length",
    explanation="The camera's focal length differs, so that all depths are wrong by one factor.",
    locations=_locations,
    parameters=_parameters,
    attach=_attach,
)
