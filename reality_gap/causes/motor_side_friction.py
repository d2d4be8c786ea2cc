"""Motor-side friction: dry friction between the force sensor of a motor and an elastic tendon.

A spool, a gearbox behind a load cell, or a motor whose force is known by its current. With the
stiffness ``K`` of the length servo, the tension ``T`` and the friction ``R``, the motor is at

    x = target + (T - R) / K,    R = F (x - y) / d

with the sliding friction ``F`` and ``y`` of the play operator with the half gap ``d`` (see
`backlash`): the friction is a spring that slips after the presliding distance ``d``. The sensor
reads ``T`` and the friction; the other end of the tendon only feels that the motor is ``R / K``
short of its target. Friction there also stretches an elastic tendon, see Coulomb friction; in a
rigid tendon both are the same.

Source of the effect: the torque of the spindle of a cable drive when it reverses, see
docs/davinci.md.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.backlash import played
from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support import elements, lugre, motors, typical_scales
from reality_gap.causes.support.motors import Motor
from reality_gap.study.system import System, column
from reality_gap.types import Floats

LEAST = 6e-3
"""Friction up to which it is not named, over the typical force of a tendon: that of a good bearing,
or of a good gearbox."""


def _motors(system: System) -> dict[str, Motor]:
    """Return the motors with a length servo and a force sensor by their tendons."""
    model, actuators = system.model, {t.name: t.actuator for t in system.tendons if t.servo}
    commanded = {
        name
        for name, motor in actuators.items()
        if model.actuator(motor).gainprm[0] != 0.0 > model.actuator(motor).biasprm[1]
    }
    found = motors.measured(system)
    return {m.element: m for m in found if m.kind == "tendon" and m.element in commanded}


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
        rubbing = _Rubbing(system, _motors(system)[name], values)
        effects.commands.append(rubbing.command)
        effects.readings.append(rubbing.read)


class _Rubbing:
    """Friction of one motor."""

    def __init__(self, system: System, motor: Motor, values: Values) -> None:
        self.motor, self.actuator = motor, system.tendon(motor.element).actuator
        self.friction, self.presliding = values["friction"], values["presliding"]
        actuator = system.model.actuator(self.actuator)
        spring = float(-actuator.biasprm[1])
        self.stiffness = spring * motor.gear**2
        self.per_command = float(actuator.gainprm[0]) / (spring * motor.gear)

    def command(self, model: mujoco.MjModel, time: Floats, command: Floats) -> Floats:
        """Return commands (n, nu) of which the motor is as short as the friction holds it.

        The changes of the tension hardly move the motor, beside those of its target.
        """
        changed, i = command.copy(), column(model, self.actuator)
        target = self.per_command * command[:, i]
        held = self._friction(target, self.presliding + self.friction / self.stiffness)
        changed[:, i] -= held / (self.stiffness * self.per_command)
        return changed

    def read(self, record: Record) -> None:
        """Add the friction to the readings of the motor's force."""
        friction = self._friction(self._position(record), self.presliding)
        for sensor in self.motor.sensors:
            record.sensors[:, record.column(sensor)] += friction / self.motor.gear

    def _friction(self, position: Floats, distance: float) -> Floats:
        """Return the friction along positions, shape (k,) [N]."""
        return np.asarray(self.friction * (position - played(position, distance)) / distance)

    def _position(self, record: Record) -> Floats:
        """Return the position of the motor, shape (k,) [m].

        Its target follows from the force by the law of the actuator; where that is saturated, it
        is the length at which the servo would exert the limit.
        """
        actuator, gear = record.model.actuator(self.actuator), self.motor.gear
        at = record.model.tendon(self.motor.element).id
        constant, stiffness, damping = actuator.biasprm[:3]
        length, velocity = gear * record.length[:, at], gear * record.velocity[:, at]
        force = record.force[:, actuator.id]
        target = (length - (force - constant - damping * velocity) / stiffness) / gear
        return np.asarray(target - gear * force / self.stiffness)


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
