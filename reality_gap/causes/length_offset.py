"""Length offset: the encoder of a tendon reads a constant too much.

A servo feeds the wrong length back. If only the zero of the log is wrong, only the reading is.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support import elements, encoders, typical_scales
from reality_gap.causes.support.encoders import READING
from reality_gap.study.system import System


def _locations(system: System) -> tuple[Location, ...]:
    used = elements.each_tendon(system, sensed="length")
    return used + encoders.readings_only(system, used)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    travel = typical_scales.tendon_travel(system)
    tolerance = encoders.tolerance(location, 0.0004 * travel)
    return (Parameter("offset", "m", 0.0133 * travel, tolerance, -1.4 * travel, 1.4 * travel),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    """Let servos feed back what the encoder reads."""
    for name in location.elements:
        tendon = system.tendon(name)
        if tendon.servo and location.note != READING:
            bias = spec.actuator(tendon.actuator).biasprm
            bias[0] -= tendon.gain * values["offset"]


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    sensors = [s for name in location.elements for s in system.tendon(name).length_sensors]

    def shift(record: Record) -> None:
        for sensor in sensors:
            record.sensors[:, record.column(sensor)] += values["offset"]

    effects.readings.append(shift)


CAUSE = Cause(
    id="length_offset",
    title="length offset",
    explanation="The encoder of a tendon reads a length with a constant error.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
)
