"""A joint whose zero is wrong: in its own encoder, or in those of its wires.

Encoders of wires are zeroed at a posture. Where a joint stood short of it by ``offset``, each of
its wires is read as ``l + l(0) - l(-offset)`` ever after, with ``l`` the drawing's length at
``qpos0`` moved by that much: about what it would be at a joint further by ``offset``. That is the
sign of an encoder of the joint itself, too: positive reads too far.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Effects, Parameter, Place, Record, Values
from reality_gap.causes.support import elements, encoders, lever_arms, servos
from reality_gap.study.system import System

EVERY = "every joint"
WIRES = "zero of its wires"


def _places(system: System) -> tuple[Place, ...]:
    own = [
        p for p in elements.each_joint(system) if encoders.matters(*encoders.encoders(system, p))
    ]
    wired = _wired(system)
    every = wired or tuple(p.elements[0] for p in own)
    group = (Place("model", every, EVERY),) if len(every) > 1 else ()
    return tuple(own) + tuple(Place("joint", (name,), WIRES) for name in wired) + group


def _wired(system: System) -> tuple[str, ...]:
    read = any(wire.servo or wire.length_sensors for wire in system.wires)
    return lever_arms.wired_joints(system) if read else ()


def _by_wires(system: System, place: Place) -> bool:
    return place.note == WIRES or (place.note == EVERY and bool(_wired(system)))


def _name(place: Place, joint: str) -> str:
    return joint if place.note == EVERY else "offset"


def _parameters(system: System, place: Place) -> tuple[Parameter, ...]:
    return tuple(_parameter(system, _name(place, joint), joint) for joint in place.elements)


def _parameter(system: System, name: str, joint: str) -> Parameter:
    if int(system.model.joint(joint).type[0]) == int(mujoco.mjtJoint.mjJNT_SLIDE):
        return Parameter(name, "m", 0.003, 0.00003, -0.1, 0.1)
    return Parameter(name, "rad", 0.05, 0.0005, -0.6, 0.6)


def _errors(
    system: System, place: Place, values: Values
) -> tuple[tuple[encoders.Encoder, float], ...]:
    """What each encoder concerned reads too much [m or rad]."""
    if not _by_wires(system, place):
        chosen = encoders.encoders(system, Place("joint", place.elements))
        return tuple((e, values[_name(place, e.element)]) for e in chosen)
    stood = {joint: -values[_name(place, joint)] for joint in place.elements}
    longer = lever_arms.lengthening(system, stood)
    chosen = encoders.encoders(system, Place("tendon", tuple(longer)))
    return tuple((e, -longer[e.element]) for e in chosen)


def _edit(spec: mujoco.MjSpec, system: System, place: Place, values: Values) -> None:
    for encoder, error in _errors(system, place, values):
        if encoder.actuator:
            servos.misread(spec, encoder.actuator, error)


def _attach(effects: Effects, system: System, place: Place, values: Values) -> None:
    errors = _errors(system, place, values)

    def shift(record: Record) -> None:
        for encoder, error in errors:
            for sensor in encoder.sensors:
                record.sensors[:, record.column(sensor)] += error

    effects.senses.append(shift)


CAUSE = Cause(
    id="joint_offset",
    title="wrong zero of a joint",
    explanation="Encoders were zeroed while a joint stood elsewhere, and misread it by as much.",
    places=_places,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
)
