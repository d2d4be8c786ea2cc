"""Motors: actuators of tendons and joints whose force is measured."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import mujoco

from reality_gap.causes.support import joint_motors
from reality_gap.study.system import System


class Motor(NamedTuple):
    """The motor of a tendon or a joint, and the sensors of its force.

    Attributes:
        kind: "tendon" or "joint".
        element: name of the tendon or joint.
        gear: gear ratio, behind the sensors.
        sensors: names of the measured sensors of its force.
    """

    kind: str
    element: str
    gear: float
    sensors: tuple[str, ...]


def measured(system: System) -> tuple[Motor, ...]:
    """Return the motors whose force is measured; not those of which several move one element."""
    model, sensors = system.model, dict[int, list[str]]()
    for name in system.sensed:
        if int(model.sensor(name).type[0]) == int(mujoco.mjtSensor.mjSENS_ACTUATORFRC):
            sensors.setdefault(int(model.sensor(name).objid[0]), []).append(name)
    found = [
        Motor(kind, element, float(model.actuator(i).gear[0]), tuple(names))
        for i, names in sorted(sensors.items())
        for kind, element in _target(system, i)
    ]
    count = Counter(motor.element for motor in found)
    return tuple(motor for motor in found if count[motor.element] == 1)


def _target(system: System, actuator: int) -> list[tuple[str, str]]:
    """Return kind and name of what an actuator moves; empty for other kinds of actuators."""
    model, name = system.model, system.model.actuator(actuator).name
    tendons = [t.name for t in system.tendons if t.actuator == name]
    if tendons:
        return [("tendon", tendons[0])]
    if joint_motors.is_motor(model, actuator):
        return [("joint", joint_motors.joint_of(system, name))]
    return []
