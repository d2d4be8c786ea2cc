"""Motor-side friction: dry friction between the force sensor of a motor and an elastic tendon.

A spool, a gearbox behind a load cell, or a motor whose force is known by its current. The length
servo overcomes this friction, so that the tendon's other end does not feel it, and the sensor reads

    T + F (x - y) / d

with the tension ``T``, the friction ``F``, the position ``x`` of the motor, and ``y`` of the play
operator with the half gap ``d`` (see `backlash`): the friction is a spring that slips after the
presliding distance ``d``. The servo is stiff, so that the motor is at its target. Friction on the
other end of an elastic tendon also stretches it, see Coulomb friction; in a rigid tendon both are
the same.

Source of the effect: the torque of the spindle of a cable drive when it reverses, see
docs/davinci.md.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from reality_gap.causes.backlash import played
from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support import elements, lugre, motors, typical_scales
from reality_gap.causes.support.motors import Motor
from reality_gap.study.system import System
from reality_gap.types import Floats

LEAST = 6e-3
"""Friction up to which it is not named, over the typical force of a tendon: that of a good bearing,
or of a good gearbox."""


def _motors(system: System) -> dict[str, Motor]:
    """Return the motors with a length servo and a force sensor by their tendons."""
    servos = {t.name for t in system.tendons if t.servo}
    found = motors.measured(system)
    return {m.element: m for m in found if m.kind == "tendon" and m.element in servos}


def _locations(system: System) -> tuple[Location, ...]:
    if system.study.inverse:
        return ()
    served = _motors(system)
    return tuple(p for p in elements.each_tendon(system) if p.elements[0] in served)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    size = typical_scales.tendon_force(system, location)
    friction = Parameter("friction", "N", 0.03 * size, 0.0, 0.0, 2.0 * size, least=LEAST * size)
    return friction, lugre.presliding_parameter(system, location)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    if values["friction"]:
        [name] = location.elements
        effects.readings.append(partial(_add, system, _motors(system)[name], values))


def _add(system: System, motor: Motor, values: Values, record: Record) -> None:
    """Add the friction to the readings of a motor's force."""
    position, distance = _target(system, motor, record), values["presliding"]
    friction = values["friction"] * (position - played(position, distance)) / distance
    for sensor in motor.sensors:
        record.sensors[:, record.column(sensor)] += friction / motor.gear


def _target(system: System, motor: Motor, record: Record) -> Floats:
    """Return the length that the servo of a tendon wants, shape (k,) [m].

    It follows from the force by the law of the actuator; where that is saturated, it is the length
    at which the servo would exert the limit.
    """
    actuator = record.model.actuator(system.tendon(motor.element).actuator)
    at = record.model.tendon(motor.element).id
    constant, stiffness, damping = actuator.biasprm[:3]
    length, velocity = motor.gear * record.length[:, at], motor.gear * record.velocity[:, at]
    force = record.force[:, actuator.id]
    wanted = length - (force - constant - damping * velocity) / stiffness
    return np.asarray(wanted / motor.gear)


CAUSE = Cause(
    id="motor_side_friction",
    title="motor-side friction",
    explanation="Dry friction between the force sensor of a motor and an elastic tendon: the "
    "sensor reads it, the other end of the tendon does not feel it.",
    locations=_locations,
    parameters=_parameters,
    attach=_attach,
    fine=True,
)
