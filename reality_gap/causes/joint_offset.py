"""Joint offset: the zero of a joint is wrong, in its own encoder or in those of its tendons.

Encoders of tendons are relative and are zeroed at ``qpos0``. Let ``l(d)`` be the nominal length of
a tendon with the joint displaced by ``d`` from there. If the joint stood at ``-offset`` when the
encoders were zeroed, a tendon of length ``l`` reads ``l + l(0) - l(-offset)``, which is about its
length with the joint displaced by ``offset``. The encoder of a joint reads ``offset`` too much; if
only the zero of the log is wrong, its servo is not affected.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import mujoco

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support import (
    encoders,
    lever_arms,
    machine_size,
    servos,
)
from reality_gap.causes.support.encoders import READING
from reality_gap.study.data import ReadState
from reality_gap.study.system import System
from reality_gap.types import Floats

EVERY = "every joint"
"""Note of the location of all joints, each with its own offset."""
TENDONS = "zero of its tendons"
"""Note of a location where the offset is in the encoders of the joint's tendons."""


def _locations(system: System) -> tuple[Location, ...]:
    own = encoders.joints_with_encoders(system)
    by_tendons = _joints_with_tendons(system)
    every = by_tendons or tuple(p.elements[0] for p in own)
    group = (Location("model", every, EVERY),) if len(every) > 1 else ()
    both = encoders.readings_only(system, own)
    tendons = [Location("joint", (name,), TENDONS) for name in by_tendons]
    return (*own, *both, *tendons, *group)


def _joints_with_tendons(system: System) -> tuple[str, ...]:
    """Return the joints that tendons with used encoders cross."""
    read = any(tendon.servo or tendon.length_sensors for tendon in system.tendons)
    return lever_arms.actuated_joints(system) if read and not system.study.inverse else ()


def _by_tendons(system: System, location: Location) -> bool:
    return location.note == TENDONS or (
        location.note == EVERY and bool(_joints_with_tendons(system))
    )


def _name(location: Location, joint: str) -> str:
    return joint if location.note == EVERY else "offset"


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return tuple(_parameter(system, location, joint) for joint in location.elements)


def _parameter(system: System, location: Location, joint: str) -> Parameter:
    name = _name(location, joint)
    if int(system.model.joint(joint).type[0]) == int(mujoco.mjtJoint.mjJNT_SLIDE):
        size = machine_size.machine_size(system)
        travel = float(size.travel[machine_size.dof(system, joint)])
        tolerance = encoders.tolerance(location, 0.0003 * travel)
        return Parameter(name, "m", 0.03 * travel, tolerance, -travel, travel)
    return Parameter(name, "rad", 0.05, encoders.tolerance(location, 0.0005), -0.6, 0.6)


def _errors(
    system: System, location: Location, values: Values
) -> tuple[tuple[encoders.Encoder, float], ...]:
    """Return the affected encoders with their errors [m or rad]."""
    if not _by_tendons(system, location):
        chosen = encoders.encoders(system, Location("joint", location.elements))
        return tuple((e, values[_name(location, e.element)]) for e in chosen)
    stood = {joint: -values[_name(location, joint)] for joint in location.elements}
    longer = lever_arms.lengthening(system, stood)
    chosen = encoders.encoders(system, Location("tendon", tuple(longer)))
    return tuple((e, -longer[e.element]) for e in chosen)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    for encoder, error in _errors(system, location, values):
        if encoder.actuator and location.note != READING:
            servos.add_reading_error(spec, encoder.actuator, error)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    errors = _errors(system, location, values)
    if system.study.inverse:
        effects.motions.append(partial(_move, errors))
        return

    def shift(record: Record) -> None:
        for encoder, error in errors:
            for sensor in encoder.sensors:
                record.sensors[:, record.column(sensor)] += error

    def start(states: dict[str, ReadState]) -> None:
        for encoder, error in errors:
            if encoder.kind == "joint" and encoder.sensors and encoder.element in states:
                read = states[encoder.element]
                states[encoder.element] = read._replace(position=read.position - error)

    effects.readings.append(shift)
    effects.starts.append(start)


def _move(
    errors: Sequence[tuple[encoders.Encoder, float]],
    model: mujoco.MjModel,
    qpos: Floats,
    qvel: Floats,
    qacc: Floats,
) -> None:
    for encoder, error in errors:
        qpos[:, model.joint(encoder.element).qposadr[0]] -= error


CAUSE = Cause(
    id="joint_offset",
    title="wrong zero of a joint",
    explanation="Encoders were zeroed at a wrong joint position, so that all readings are shifted.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
)
