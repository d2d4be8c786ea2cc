"""A joint whose zero is wrong: in its own encoder, or in those of its wires.

Encoders of wires are zeroed at a posture. Where a joint stood short of it by ``offset``, each of
its wires is read as ``l + l(0) - l(-offset)`` ever after, with ``l`` the drawing's length at
``qpos0`` moved by that much: about what it would be at a joint further by ``offset``. That is the
sign of an encoder of the joint itself, too: positive reads too far.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support import elements, encoders, lever_arms, servos
from reality_gap.study.system import System

EVERY = "every joint"
TENDONS = "zero of its wires"


def _locations(system: System) -> tuple[Location, ...]:
    own = [
        p for p in elements.each_joint(system) if encoders.matters(*encoders.encoders(system, p))
    ]
    wired = _wired(system)
    every = wired or tuple(p.elements[0] for p in own)
    group = (Location("model", every, EVERY),) if len(every) > 1 else ()
    return tuple(own) + tuple(Location("joint", (name,), TENDONS) for name in wired) + group


def _wired(system: System) -> tuple[str, ...]:
    read = any(tendon.servo or tendon.length_sensors for tendon in system.tendons)
    return lever_arms.actuated_joints(system) if read else ()


def _by_tendons(system: System, location: Location) -> bool:
    return location.note == TENDONS or (location.note == EVERY and bool(_wired(system)))


def _name(location: Location, joint: str) -> str:
    return joint if location.note == EVERY else "offset"


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return tuple(_parameter(system, _name(location, joint), joint) for joint in location.elements)


def _parameter(system: System, name: str, joint: str) -> Parameter:
    if int(system.model.joint(joint).type[0]) == int(mujoco.mjtJoint.mjJNT_SLIDE):
        return Parameter(name, "m", 0.003, 0.00003, -0.1, 0.1)
    return Parameter(name, "rad", 0.05, 0.0005, -0.6, 0.6)


def _errors(
    system: System, location: Location, values: Values
) -> tuple[tuple[encoders.Encoder, float], ...]:
    """What each encoder concerned reads too much [m or rad]."""
    if not _by_tendons(system, location):
        chosen = encoders.encoders(system, Location("joint", location.elements))
        return tuple((e, values[_name(location, e.element)]) for e in chosen)
    stood = {joint: -values[_name(location, joint)] for joint in location.elements}
    longer = lever_arms.lengthening(system, stood)
    chosen = encoders.encoders(system, Location("tendon", tuple(longer)))
    return tuple((e, -longer[e.element]) for e in chosen)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    for encoder, error in _errors(system, location, values):
        if encoder.actuator:
            servos.misread(spec, encoder.actuator, error)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    errors = _errors(system, location, values)

    def shift(record: Record) -> None:
        for encoder, error in errors:
            for sensor in encoder.sensors:
                record.sensors[:, record.column(sensor)] += error

    effects.readings.append(shift)


CAUSE = Cause(
    id="joint_offset",
    title="wrong zero of a joint",
    explanation="Encoders were zeroed while a joint stood elsewhere, and misread it by as much.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
)
