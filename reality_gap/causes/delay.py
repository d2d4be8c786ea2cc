"""Delay: commands act late, or sensors are read late, by a constant time.

MuJoCo delays commands by at least one time step. A shorter delay is an effect on the commands,
which interpolates linearly and equals MuJoCo's delay at one step, so that the replay is a
continuous function of the delay. Sensors of one kind share a bus and therefore a delay, as do the
position and the orientation of a marker. The delay of sensors shifts the record, because other
causes edit the record; MuJoCo's own sensor delay would act before them.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support import elements
from reality_gap.study.system import System, column
from reality_gap.types import Floats

FRAMES = tuple(
    int(getattr(mujoco.mjtSensor, f"mjSENS_FRAME{part}"))
    for part in ("POS", "QUAT", "XAXIS", "YAXIS", "ZAXIS")
)
LINEAR = 1
"""MuJoCo's value of ``interp`` for linear interpolation."""


def _locations(system: System) -> tuple[Location, ...]:
    kinds = dict.fromkeys(_bus(system, name) for name in system.sensed)
    groups = [tuple(name for name in system.sensed if _bus(system, name) == kind) for kind in kinds]
    actuators = elements.each_actuator(system) + elements.all_actuators(system)
    return actuators + tuple(Location("sensor", group) for group in groups)


def _bus(system: System, sensor: str) -> int:
    """Return a number that sensors on one bus share: their kind; all kinds of frames are one."""
    kind = int(system.model.sensor(sensor).type[0])
    return FRAMES[0] if kind in FRAMES else kind


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return (Parameter("delay", "s", 0.004, 0.00005, 0.0, 0.3),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    step = spec.option.timestep
    if location.kind != "actuator" or values["delay"] < step:
        return
    for name in location.elements:
        actuator = spec.actuator(name)
        actuator.delay += values["delay"]
        actuator.nsample = math.ceil(actuator.delay / step) + 1
        actuator.interp = LINEAR


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    delay = values["delay"]
    if location.kind == "sensor":
        effects.readings.append(lambda record: _late(record, location.elements, delay))
        return

    def command(model: mujoco.MjModel, time: Floats, command: Floats) -> Floats:
        columns = [column(model, name) for name in location.elements]
        command = command.copy()
        change = np.diff(command[:, columns], axis=0)
        command[1:, columns] -= change * delay / model.opt.timestep
        return command

    if delay < system.model.opt.timestep:
        effects.commands.append(command)


def _late(record: Record, sensors: tuple[str, ...], delay: float) -> None:
    for name in sensors:
        for i in range(int(record.model.sensor(name).dim[0])):
            column = record.column(name, i)
            values = record.sensors[:, column]
            record.sensors[:, column] = np.interp(record.time - delay, record.time, values)


CAUSE = Cause(
    id="delay",
    title="delay",
    explanation="Commands act late, or sensors are read late, by a constant time.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
)
