"""Encoder scale: a joint's encoder reads its motion times a factor, as with a wrong gear ratio.

At the position ``q`` it reads ``q0 + (1 + scale) (q - q0)``, where ``q0`` is the position at the
model's ``qpos0``. A servo feeds the wrong position and velocity back, or the wrong position only
where speeds have another source. If only the conversion of the log is wrong, the reading alone is;
it may then be mirrored, which is a scale of -2.
"""

from __future__ import annotations

from functools import partial

import mujoco

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support import encoders, servos
from reality_gap.causes.support.encoders import POSITION, READING
from reality_gap.study.data import ReadState
from reality_gap.study.system import System
from reality_gap.types import Floats

STABLE, MIRRORED = -0.9, -3.0
"""Smallest scales, of an encoder that a servo needs and of a reading that may have another sign."""


def _locations(system: System) -> tuple[Location, ...]:
    used = encoders.joints_with_encoders(system)
    positions = () if system.study.inverse else encoders.positions_only(system, used)
    return used + encoders.readings_only(system, used) + positions


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    [encoder] = encoders.encoders(system, location)
    fed = bool(encoder.actuator) and location.note != READING
    low = STABLE if fed or system.study.inverse else MIRRORED
    tolerance = encoders.tolerance(location, 0.0003)
    return (Parameter("scale", "1", 0.02, tolerance, low, 2.0),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    [encoder] = encoders.encoders(system, location)
    if encoder.actuator and location.note != READING:
        about = encoders.zero(system, encoder.element)
        speed = location.note != POSITION
        servos.add_reading_error(spec, encoder.actuator, 0.0, values["scale"], about, speed)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    [encoder] = encoders.encoders(system, location)
    about, name = encoders.zero(system, encoder.element), encoder.element
    speeds = encoders.speed_sensors(system, name) if location.note != POSITION else ()
    if system.study.inverse:
        effects.motions.append(partial(_shrink, encoder.element, about, 1.0 + values["scale"]))
        return

    def stretch(record: Record) -> None:
        travel = encoders.true_position(record, encoder) - about
        encoders.add_to_reading(record, encoder, values["scale"] * travel)
        for sensor in speeds:
            record.sensors[:, record.column(sensor)] *= 1.0 + values["scale"]

    def start(states: dict[str, ReadState]) -> None:
        read, factor = states.get(encoder.element), 1.0 + values["scale"]
        if read is not None and factor:
            position = about + (read.position - about) / factor
            states[encoder.element] = read._replace(position=position, speed=read.speed / factor)

    effects.readings.append(stretch)
    effects.starts.append(start)


def _shrink(
    joint: str,
    about: float,
    factor: float,
    model: mujoco.MjModel,
    qpos: Floats,
    qvel: Floats,
    qacc: Floats,
) -> None:
    at, dof = model.joint(joint).qposadr[0], model.joint(joint).dofadr[0]
    qpos[:, at] = about + (qpos[:, at] - about) / factor
    qvel[:, dof] /= factor
    qacc[:, dof] /= factor


CAUSE = Cause(
    id="encoder_scale",
    title="scale of a joint encoder",
    explanation="An encoder reads a joint's motion times a factor, as with a wrong gear ratio; a "
    "reading with a scale of -2 has the opposite sign.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
)
