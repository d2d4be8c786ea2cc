"""Camera focal length: the pose estimation used a wrong focal length.

The depth of a marker of known size is estimated as focal length times size over size in the image,
and its lateral position as position in the image times depth over focal length. A wrong focal
length therefore only scales the depth. MuJoCo's cameras look along -z.
"""

from __future__ import annotations

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support import frames
from reality_gap.study.system import System

DEPTH = 2
"""Component of a position in a camera's frame that is its depth."""


def _locations(system: System) -> tuple[Location, ...]:
    return frames.camera_locations(system, frames.position_sensors(system))


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return (Parameter("scale", "1", 0.02, 0.0005, -0.5, 1.0),)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    sensors = [
        s
        for s in frames.position_sensors(system)
        if frames.camera_of(system, s) == location.elements[0]
    ]

    def stretch(record: Record) -> None:
        for sensor in sensors:
            record.sensors[:, record.column(sensor, DEPTH)] *= 1.0 + values["scale"]

    effects.readings.append(stretch)


CAUSE = Cause(
    id="camera_focal",
    title="wrong focal length",
    explanation="The camera's focal length is wrong, so that all depths are wrong by one factor.",
    locations=_locations,
    parameters=_parameters,
    attach=_attach,
)
