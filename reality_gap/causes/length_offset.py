"""An encoder of a wire that reads a constant too much."""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Effects, Parameter, Place, Record, Values
from reality_gap.causes.support import elements
from reality_gap.study.system import System


def _places(system: System) -> tuple[Place, ...]:
    return elements.each_wire(system, sensed="length")


def _parameters(system: System, place: Place) -> tuple[Parameter, ...]:
    return (Parameter("offset", "m", 0.001, 0.00003, -0.1, 0.1),)


def _edit(spec: mujoco.MjSpec, system: System, place: Place, values: Values) -> None:
    """What feeds the length back acts on what the encoder reads."""
    for name in place.elements:
        wire = system.wire(name)
        if wire.servo:
            bias = spec.actuator(wire.actuator).biasprm
            bias[0] -= wire.gain * values["offset"]


def _attach(effects: Effects, system: System, place: Place, values: Values) -> None:
    sensors = [s for name in place.elements for s in system.wire(name).length_sensors]

    def shift(record: Record) -> None:
        for sensor in sensors:
            record.sensors[:, record.column(sensor)] += values["offset"]

    effects.senses.append(shift)


CAUSE = Cause(
    id="length_offset",
    title="length offset",
    explanation="An encoder reads a wire longer or shorter than it is, always by as much.",
    places=_places,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
)
