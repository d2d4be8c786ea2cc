"""Typical scales of forces, velocities and positions, from which causes derive their parameters.

What the log measures comes first; what it does not measure comes from the model, see
`reality_gap.causes.support.machine_size` and `reality_gap.causes.support.shown_forces`.
"""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from reality_gap.causes.base import Location
from reality_gap.causes.support import actuators, machine_size
from reality_gap.causes.support.shown_forces import spaced, typical_loads
from reality_gap.study.data import Channel, JointUse, Reading
from reality_gap.study.system import System
from reality_gap.types import Floats

RATE = 1.35
"""Typical velocity of a tendon over its travel [1/s]."""
RATED = 4.0
"""Largest force of a motor over the largest one in a log."""
WEAKEST = 0.05
"""Largest force of the weakest motor of a machine over that of the strongest one."""
FORCE_ERROR = 0.0008
"""Standard deviation of forces that no model contains, such as a motor's constant force, the dry
friction of its bearings and the zero of its force sensor, over the motor's largest force."""
OF_MOTOR = 0.5
"""Share of it that a motor exerts at rest, or that it needs to move at all; the others are friction
behind the motor, or errors of a sensor."""
FRICTION_ERROR = 0.04
"""Standard deviation of these forces over the dry friction that the model has."""

SHORT = 0.25
"""Largest typical change of length of tendons, over the size of the largest link."""
SMALL = 0.1
"""Lever arm of a tendon, over its largest one, below which it does not matter for the force."""

MOST, MOST_UNKNOWN = 2.0, 20.0
"""Largest friction of a joint over its typical force, and where neither a limit of the model nor
measured efforts tell how strong its motor is."""


def joint_force(system: System, location: Location) -> tuple[str, float]:
    """Return unit and typical size of a joint's force: RMS of its effort, or that of the model."""
    joint = location.elements[0]
    unit = "N" if slides(system, joint) else "N m"
    if use := system.study.uses.get(joint):
        return unit, use.force
    size = max((float(np.sqrt(np.mean(e**2))) for e in _efforts(system, joint)), default=0.0)
    return unit, size or float(typical_loads(system)[machine_size.dof(system, joint)])


def force_tolerance(system: System, location: Location) -> float:
    """Return the standard deviation of a force that no model contains [N or N m].

    Args:
        system: the machine.
        location: an actuator, or joints, of which the weakest one counts.
    """
    if location.kind == "actuator":
        model = system.model
        limit = float(
            machine_size.machine_size(system).limit[model.actuator(location.elements[0]).id]
        )
        return FORCE_ERROR * (limit or actuator_force(system, location)[1] / machine_size.MOTOR)
    return min(
        max(FORCE_ERROR * _rated_force(system, joint), FRICTION_ERROR * _friction(system, joint))
        for joint in location.elements
    )


def _friction(system: System, joint: str) -> float:
    """Return the dry friction of a joint in the model [N or N m]."""
    return float(system.model.dof_frictionloss[machine_size.dof(system, joint)])


def _rated_force(system: System, joint: str) -> float:
    """Return the largest force of a joint's motor [N or N m].

    It is that of the model, or follows from the largest measured efforts of this joint and of the
    strongest one, or from the typical force.
    """
    size, at = machine_size.machine_size(system), machine_size.dof(system, joint)
    measured = {
        name: max((float(np.abs(e).max()) for e in _efforts(system, name)), default=0.0)
        for name in system.joints
        if slides(system, name) == slides(system, joint)
    }
    used = max(measured[joint], WEAKEST * max(measured.values()))
    known = float(size.rated[at]) or RATED * used
    return known or float(typical_loads(system)[at]) / machine_size.MOTOR


def weakest_force(system: System, location: Location) -> tuple[str, float]:
    """Return unit and typical size of the force of the weakest of a location's joints."""
    return min(joint_force(system, Location("joint", (name,))) for name in location.elements)


def most_friction(system: System, location: Location) -> float:
    """Return the largest friction of a location's joints over their typical force."""
    limited = machine_size.machine_size(system).limited
    measured = {one.sensor for one in system.study.channels if one.kind == "effort"}
    known = (
        bool(limited[machine_size.dof(system, joint)]) or joint in measured
        for joint in location.elements
    )
    return MOST if all(known) else MOST_UNKNOWN


def joint_speed(system: System, location: Location) -> float:
    """Return the typical velocity of a joint: the measured RMS, or else half its range a second."""
    joint = location.elements[0]
    if use := system.study.uses.get(joint):
        return use.speed
    return _speed(_positions(system, joint)) or _half_range(system, joint)


def _speed(readings: list[Reading]) -> float:
    """Return the RMS of the velocity of a position in several episodes; 0 without readings."""
    squares = [
        float(np.mean((np.diff(one.value) / np.diff(one.time)) ** 2))
        for one in map(spaced, readings)
    ]
    return float(np.sqrt(np.mean(squares))) if squares else 0.0


def joint_damping(system: System, location: Location) -> tuple[str, float]:
    """Return unit and size of the damping that gives a joint's typical force at its speed."""
    unit, force = joint_force(system, location)
    per = "s/m" if slides(system, location.elements[0]) else "s/rad"
    return f"{unit} {per}", force / joint_speed(system, location)


def joint_travel(system: System, location: Location) -> tuple[str, float]:
    """Return unit and typical size of a joint's motion: the measured one, or half its range."""
    joint = location.elements[0]
    unit, use = "m" if slides(system, joint) else "rad", system.study.uses.get(joint)
    if use is not None and use.travel:
        return unit, use.travel
    travels = [float(np.ptp(reading.value)) for reading in _positions(system, joint)]
    return unit, max(travels, default=0.0) or _half_range(system, joint)


def joint_uses(system: System) -> dict[str, JointUse]:
    """Return how each joint is used in the log, on which what some causes add depends."""
    at_joints = {joint: Location("joint", (joint,)) for joint in system.joints}
    return {
        joint: JointUse(
            joint_speed(system, at), joint_force(system, at)[1], joint_travel(system, at)[1]
        )
        for joint, at in at_joints.items()
    }


def joint_inertia(system: System, joint: str) -> float:
    """Return the inertia that moves with a joint [kg m^2 or kg]."""
    return float(machine_size.machine_size(system).inertia[machine_size.dof(system, joint)])


def actuator_force(system: System, location: Location) -> tuple[str, float]:
    """Return unit and typical size of an actuator's force before its gear."""
    model, size = system.model, machine_size.machine_size(system)
    actuator = model.actuator(location.elements[0])
    limit, gear = float(size.limit[actuator.id]), abs(float(actuator.gear[0])) or 1.0
    kind, target = int(actuator.trntype[0]), int(actuator.trnid[0])
    if kind == int(mujoco.mjtTrn.mjTRN_TENDON):
        return "N", machine_size.TENSION * limit if limit else _load(system, target) / gear
    if kind in actuators.JOINT_TRANSMISSIONS:
        joint = model.joint(target).name
        load = float(typical_loads(system)[model.jnt_dofadr[target]]) / gear
        load = min(load, machine_size.MOTOR * limit) if limit else load
        return ("N" if joint and slides(system, joint) else "N m"), load
    return "N m", machine_size.MOTOR * limit if limit else 1.0


def tendon_force(system: System, location: Location) -> float:
    """Return the typical force of the weakest of a location's tendons [N]."""
    motors = {t.name: t.actuator for t in system.tendons}
    return min(
        actuator_force(system, Location("actuator", (motors[name],)))[1]
        if name in motors
        else _load(system, system.model.tendon(name).id)
        for name in location.elements
    )


def _load(system: System, tendon: int) -> float:
    """Return the force of a tendon that exerts the typical force of one of its joints [N]."""
    arms = machine_size.machine_size(system).arms[tendon]
    on = arms > SMALL * arms.max(initial=0.0)
    return float(np.max(typical_loads(system)[on] / arms[on], initial=0.0)) or 1.0


def tendon_travel(system: System) -> float:
    """Return the typical change of length of the machine's tendons, actuated if it has any [m].

    It is at most `SHORT` times the largest link, for joints whose range is not limited.
    """
    size = machine_size.machine_size(system)
    ids = [system.model.tendon(t.name).id for t in system.tendons]
    travels = size.tendon_travel[ids] if ids else size.tendon_travel
    return min(float(np.median(travels)), SHORT * size.link) if travels.any() else size.link


def lever_arm(system: System) -> float:
    """Return the typical largest lever arm of the machine's actuated tendons at hinges [m]."""
    size, model = machine_size.machine_size(system), system.model
    hinges = [machine_size.dof(system, j) for j in system.joints if not slides(system, j)]
    ids = [model.tendon(t.name).id for t in system.tendons]
    arms = size.arms[np.ix_(ids, hinges)].max(axis=1, initial=0.0)
    return float(np.median(arms)) if arms.any() else size.link


def tendon_speed(system: System) -> float:
    """Return the typical velocity of the machine's tendons [m/s]."""
    return RATE * tendon_travel(system)


def own_tendon_speed(system: System, tendon: str) -> float:
    """Return the typical velocity of a tendon: the measured RMS, or that of all tendons [m/s]."""
    return _speed(_lengths(system, tendon)) or tendon_speed(system)


def own_tendon_travel(system: System, tendon: str) -> float:
    """Return the typical change of length of a tendon: the measured one, or that of all [m]."""
    travels = [float(np.ptp(reading.value)) for reading in _lengths(system, tendon)]
    return max(travels, default=0.0) or tendon_travel(system)


def link_size(system: System) -> float:
    """Return the size of the machine's largest link [m]."""
    return machine_size.machine_size(system).link


def end_force(system: System, body: str) -> float:
    """Return a typical force on a body [N]; see `machine_size.end_force`."""
    return machine_size.end_force(system, body, typical_loads(system))


def slides(system: System, joint: str) -> bool:
    """Return whether a joint is a slide."""
    return int(system.model.joint(joint).type[0]) == int(mujoco.mjtJoint.mjJNT_SLIDE)


def _efforts(system: System, joint: str) -> list[Floats]:
    """Return the measured efforts of a joint in each episode, shape (k,) each [N or N m]."""
    return [
        reading.value
        for channel, reading in _readings(system)
        if channel.kind == "effort" and channel.sensor == joint and len(reading.value)
    ]


def _half_range(system: System, joint: str) -> float:
    return float(machine_size.machine_size(system).travel[machine_size.dof(system, joint)]) or 1.0


def _readings(system: System) -> Iterator[tuple[Channel, Reading]]:
    for episode in system.study.episodes:
        if episode.readings:
            yield from zip(system.study.channels, episode.readings, strict=True)


def _positions(system: System, joint: str) -> list[Reading]:
    """Return the measured positions of a joint in each episode."""
    return _measured(system, mujoco.mjtSensor.mjSENS_JOINTPOS, system.model.joint(joint).id)


def _lengths(system: System, tendon: str) -> list[Reading]:
    """Return the measured lengths of a tendon in each episode."""
    return _measured(system, mujoco.mjtSensor.mjSENS_TENDONPOS, system.model.tendon(tendon).id)


def _measured(system: System, kind: mujoco.mjtSensor, element: int) -> list[Reading]:
    """Return the readings of the sensors of a kind at an element in each episode."""
    model = system.model
    return [
        reading
        for channel, reading in _readings(system)
        if channel.kind == "sensor"
        and int(model.sensor(channel.sensor).type[0]) == int(kind)
        and int(model.sensor(channel.sensor).objid[0]) == element
        and len(reading.time) > 1
    ]
