"""Efforts: measured forces of joint motors, as sensors or as efforts for inverse dynamics."""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Location
from reality_gap.causes.support import joint_motors, typical_scales
from reality_gap.study.system import System

_SENSOR = mujoco.mjtSensor


def each(system: System) -> tuple[Location, ...]:
    """Return each sensor of a joint motor's force, or each joint with a measured effort."""
    if system.study.inverse:
        return tuple(Location("joint", (name,)) for name in joints(system))
    return tuple(Location("sensor", (name,)) for name in _sensors(system))


def each_and_all(system: System) -> tuple[Location, ...]:
    """Return each measured force, and all together if there are several."""
    found = each(system)
    names = tuple(location.elements[0] for location in found)
    return (*found, Location(found[0].kind, names)) if len(found) > 1 else found


def joints(system: System) -> tuple[str, ...]:
    """Return the joints whose efforts are compared by inverse dynamics."""
    found = (c.sensor for c in system.study.channels if c.kind == "effort")
    return tuple(dict.fromkeys(found))


def of_joint(system: System, joint: str) -> tuple[tuple[str, float], ...]:
    """Return the sensors of the force of a joint's motor, each with the gear in front of it."""
    model, found = system.model, list[tuple[str, float]]()
    for name in _sensors(system):
        motor = _motor(system, name)
        if motor.kind == "joint" and motor.elements == (joint,):
            found.append((name, 1.0))
        elif motor.kind == "actuator" and motor.elements[0] in joint_motors.motors_of(
            system, joint
        ):
            found.append((name, float(model.actuator(motor.elements[0]).gear[0])))
    return tuple(found)


def typical(system: System, sensor: str) -> tuple[str, float]:
    """Return unit and typical size of what a sensor of a joint motor's force measures."""
    motor = _motor(system, sensor)
    if motor.kind == "actuator":
        return typical_scales.actuator_force(system, motor)
    return typical_scales.joint_force(system, motor)


def tolerance(system: System, sensor: str) -> float:
    """Return the standard deviation of the zero of a sensor of a joint motor's force."""
    return typical_scales.force_tolerance(system, _motor(system, sensor))


def _motor(system: System, sensor: str) -> Location:
    """Return the actuator or the joint whose force a sensor measures."""
    model, measures = system.model, system.model.sensor(sensor)
    target = int(measures.objid[0])
    if int(measures.type[0]) == int(_SENSOR.mjSENS_ACTUATORFRC):
        return Location("actuator", (model.actuator(target).name,))
    return Location("joint", (model.joint(target).name,))


def _sensors(system: System) -> tuple[str, ...]:
    """Return the measured sensors of the force of a joint motor."""
    model, found = system.model, list[str]()
    for name in system.sensed:
        kind, target = int(model.sensor(name).type[0]), int(model.sensor(name).objid[0])
        of_motor = kind == int(_SENSOR.mjSENS_ACTUATORFRC) and joint_motors.is_motor(model, target)
        if of_motor or kind == int(_SENSOR.mjSENS_JOINTACTFRC):
            found.append(name)
    return tuple(found)
