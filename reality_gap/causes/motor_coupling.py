"""Motor coupling: the motor of a joint also turns with the joint before it.

Where a belt, a cable or a differential gear leads to a joint from a motor before another joint, the
motor turns by ``q + ratio p`` with the positions ``q`` of its joint and ``p`` of the joint before,
and its torque acts on both joints in the same proportion. The encoder on the motor reads this sum.
If only the log contains a sum, as with absolute angles of links, only the reading is wrong. The
encoder is zeroed at the model's ``qpos0``.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support import elements, encoders, joint_motors, joint_tree, servos
from reality_gap.study.system import System

WITH = "with "
"""First word of the note of a location; the name of the joint before follows."""
READING = ", reading only"
"""End of the note of a location where the motor does not turn with the joint before."""


def _locations(system: System) -> tuple[Location, ...]:
    if system.study.inverse:
        return ()
    found = []
    for [name] in (location.elements for location in elements.each_joint(system)):
        before = joint_tree.joint_before(system, name)
        if before and len(joint_motors.motors_of(system, name)) == 1:
            found.append(Location("joint", (name,), WITH + before))
        if before and _sensors(system, name):
            found.append(Location("joint", (name,), WITH + before + READING))
    return tuple(found)


def _sensors(system: System, joint: str) -> tuple[str, ...]:
    """Return the measured sensors of a joint's position."""
    return encoders.encoders(system, Location("joint", (joint,)))[0].sensors


def _before(location: Location) -> str:
    return location.note.removeprefix(WITH).removesuffix(READING)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return (Parameter("ratio", "1", 0.02, 0.00005, -2.0, 2.0),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    ratio = values["ratio"]
    if not ratio or location.note.endswith(READING):
        return
    [joint], before = location.elements, _before(location)
    tendon = joint_tree.add_fixed_tendon(spec, CAUSE.id, joint, before, ratio)
    actuator = spec.actuator(joint_motors.motors_of(system, joint)[0])
    actuator.trntype, actuator.target = mujoco.mjtTrn.mjTRN_TENDON, tendon.name
    servos.add_reading_error(spec, actuator.name, -ratio * encoders.zero(system, before))


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    ratio, [joint], before = values["ratio"], location.elements, _before(location)
    sensors, speeds = _sensors(system, joint), encoders.speed_sensors(system, joint)
    zero = encoders.zero(system, before)

    def add(record: Record) -> None:
        other = record.model.joint(before)
        moved = ratio * (record.qpos[:, other.qposadr[0]] - zero)
        turned = ratio * record.qvel[:, other.dofadr[0]]
        for name in sensors:
            record.sensors[:, record.column(name)] += moved
        for name in speeds:
            record.sensors[:, record.column(name)] += turned

    if ratio and (sensors or speeds):
        effects.readings.append(add)


CAUSE = Cause(
    id="motor_coupling",
    title="motor that turns with another joint",
    explanation="The motor or the encoder of a joint also turns with the joint before it.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
)
