"""Joint elasticity: a gear between motor and link gives way in proportion to its torque.

The encoder is on the motor, as in most servos and in arms with harmonic drives, and so is the
armature of the joint, the inertia of the rotor. Source of the model: M. W. Spong, "Modeling and
Control of Elastic Joint Robots", J. Dyn. Sys., Meas., Control 109 (1987). A replay solves it
(`support/elastic_gear.py`). The extended model has a softer servo instead, which is right at rest:
at the torque ``T`` the motor is ahead of the link by ``c T`` with the compliance ``c``, so that ``T
= kp (u - q - c T)`` is ``s kp (u - q)`` with ``s = 1 / (1 + kp c)``. The rotor then turns by the
share ``s`` of the link's motion, so that its inertia there is multiplied by ``s^2``.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Hook, Location, Parameter, Record, Values
from reality_gap.causes.support import efforts, encoders, joint_motors, typical_scales
from reality_gap.causes.support.elastic_gear import ElasticGear
from reality_gap.study.system import System

ODDS = -2.0
"""Log odds of an elastic gear [nats]: it changes the gain of a servo and the reading of its encoder
at once, and explains a little of many errors."""


def _locations(system: System) -> tuple[Location, ...]:
    if system.study.inverse:
        return ()
    return tuple(
        Location("joint", (name,))
        for name in system.joints
        if _has_one_motor(system, name)
        and encoders.is_used(*encoders.encoders(system, Location("joint", (name,))))
    )


def _has_one_motor(system: System, joint: str) -> bool:
    """Return whether one motor moves a joint, and does not push it away from its command."""
    motors = [system.model.actuator(name) for name in joint_motors.motors_of(system, joint)]
    if len(motors) != 1 or not motors[0].gear[0]:
        return False
    return not joint_motors.is_servo(system.model, motors[0].id) or motors[0].biasprm[1] < 0.0


def _has_rotor(model: mujoco.MjModel, joint: str, motor: str) -> bool:
    """Return whether a motor has an inertia or a damping that an elastic gear moves."""
    i, dof = int(model.actuator(motor).id), int(model.joint(joint).dofadr[0])
    own = (model.dof_armature[dof], model.actuator_armature[i], model.actuator_damping[i].any())
    return any(bool(one) for one in own)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    unit, travel = typical_scales.joint_travel(system, location)
    force_unit, force = typical_scales.joint_force(system, location)
    soft = travel / force
    sizes = (0.01 * soft, 7e-5 * soft, 0.0, 0.4 * soft)
    return (Parameter("compliance", "m/N" if unit == "m" else f"{unit}/({force_unit})", *sizes),)


def _softening(system: System, location: Location, compliance: float) -> float:
    """Return the stiffness of a servo over that with an elastic gear; 1 without feedback."""
    [name] = joint_motors.motors_of(system, location.elements[0])
    actuator = system.model.actuator(name)
    if not joint_motors.is_servo(system.model, actuator.id):
        return 1.0
    return 1.0 - float(actuator.biasprm[1] * actuator.gear[0] ** 2) * compliance


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    softer = _softening(system, location, values["compliance"])
    if softer != 1.0:
        [name] = joint_motors.motors_of(system, location.elements[0])
        actuator, joint = spec.actuator(name), spec.joint(location.elements[0])
        actuator.gainprm[0] /= softer
        actuator.biasprm[:3] /= softer
        joint.armature /= softer**2


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    compliance, [joint] = values["compliance"], location.elements
    if not compliance:
        return
    [name] = joint_motors.motors_of(system, joint)
    [encoder] = encoders.encoders(system, location)
    speeds, forces = encoders.speed_sensors(system, joint), efforts.of_joint(system, joint)
    softer = _softening(system, location, compliance)
    gears: dict[int, ElasticGear] = {}

    def make(model: mujoco.MjModel) -> Hook:
        gears[id(model)] = gear = ElasticGear(model, name, joint, compliance, softer)
        return gear

    def read(record: Record) -> None:
        i, hook = record.model.actuator(name).id, gears.pop(id(record.model), None)
        torque = record.model.actuator_gear[i, 0] * record.force[:, i]
        motor, spring = (torque, torque) if hook is None else hook.exerted(len(torque))
        ahead = compliance * spring
        encoders.add_to_reading(record, encoder, ahead)
        for sensor in speeds:
            record.sensors[:, record.column(sensor)] += np.gradient(ahead, record.time)
        for sensor, ratio in forces:
            record.sensors[:, record.column(sensor)] += (motor - torque) / ratio

    if softer != 1.0 or _has_rotor(system.model, joint, name):
        effects.add_hook(make)
    effects.readings.append(read)
    effects.of_forces.append(read)


def _prior(location: Location) -> float:
    return ODDS


CAUSE = Cause(
    id="joint_elasticity",
    title="elastic gear",
    explanation="A gear gives way under its torque, so that the motor is ahead of the link.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
    prior=_prior,
)
