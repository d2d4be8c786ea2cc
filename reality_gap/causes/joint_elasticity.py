"""Joint elasticity: a gear between motor and link gives way in proportion to its torque.

The encoder is on the motor, as in most servos and in arms with harmonic drives. At the torque ``T``
the motor is ahead of the link by ``c T`` with the compliance ``c``, and a servo with the gains
``kp`` and ``kd`` in front of the gear exerts ``kp (u - q - c T) - kd (q' + c T')``. This is ``s (kp
(u - q) - kd q')`` with ``s = 1 / (1 + kp c)``, filtered by a lag of ``kd c s``, exactly if the
rotor has no inertia. The inertia of a rotor is multiplied by ``s^2``, an approximation for light
ones: it leaves out that the motor also turns with its command, and that its inertia takes a part of
the torque. Source of the model: M. W. Spong, "Modeling and Control of Elastic Joint Robots", J.
Dyn. Sys., Meas., Control 109 (1987).
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support import encoders, joint_motors, typical_scales
from reality_gap.causes.support.force_lag import ForceLag
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
        if len(joint_motors.motors_of(system, name)) == 1
        and encoders.is_used(*encoders.encoders(system, Location("joint", (name,))))
    )


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
    speeds = encoders.speed_sensors(system, joint)
    actuator, softer = system.model.actuator(name), _softening(system, location, compliance)
    damping = -float(actuator.biasprm[2] * actuator.gear[0] ** 2)
    late = damping * compliance / softer

    def read(record: Record) -> None:
        i = record.model.actuator(name).id
        ahead = compliance * record.model.actuator_gear[i, 0] * record.force[:, i]
        encoders.add_to_reading(record, encoder, ahead)
        for sensor in speeds:
            record.sensors[:, record.column(sensor)] += np.gradient(ahead, record.time)

    if softer != 1.0 and damping > 0.0:
        effects.add_hook(lambda model: ForceLag(model, (name,), late))
    effects.readings.append(read)


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
