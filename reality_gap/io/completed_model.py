"""Completed model: a model in which all that a log may contain has a name and a sensor."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import mujoco

from reality_gap.simulation.light_model import light_spec

_SENSOR, _OBJECT = mujoco.mjtSensor, mujoco.mjtObj
_SIMPLE = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
_WANTED = (
    (_SENSOR.mjSENS_JOINTPOS, _OBJECT.mjOBJ_JOINT, "position"),
    (_SENSOR.mjSENS_TENDONPOS, _OBJECT.mjOBJ_TENDON, "length"),
    (_SENSOR.mjSENS_JOINTVEL, _OBJECT.mjOBJ_JOINT, "velocity"),
    (_SENSOR.mjSENS_ACTUATORFRC, _OBJECT.mjOBJ_ACTUATOR, "force"),
)
"""Sensors that a machine may have, with the last word of their names."""


def complete_model(spec: mujoco.MjSpec) -> tuple[mujoco.MjSpec, tuple[str, ...]]:
    """Name the joints, tendons, actuators and sensors of a model, and add sensors that it lacks.

    An actuator without a name gets that of the joint or tendon that it moves. Visual elements are
    left out.

    Args:
        spec: the model; it is not changed.

    Returns:
        The completed copy, and the names of the added sensors.
    """
    spec = light_spec(spec)
    _name_all(spec)
    measured = {(sensor.type, sensor.objname) for sensor in spec.sensors}
    taken = {sensor.name for sensor in spec.sensors}
    added = []
    for kind, objtype, word in _WANTED:
        for name in _targets(spec, kind):
            if (kind, name) not in measured:
                sensor = _free(f"{name}_{word}", taken)
                spec.add_sensor(name=sensor, type=kind, objtype=objtype, objname=name)
                added.append(sensor)
    return spec, tuple(added)


def _targets(spec: mujoco.MjSpec, kind: mujoco.mjtSensor) -> Iterator[str]:
    """Yield the names of the elements that may have a sensor of a kind."""
    if kind in (_SENSOR.mjSENS_JOINTPOS, _SENSOR.mjSENS_JOINTVEL):
        yield from (joint.name for joint in spec.joints if joint.type in _SIMPLE)
    elif kind == _SENSOR.mjSENS_TENDONPOS:
        yield from (tendon.name for tendon in spec.tendons)
    else:
        yield from (actuator.name for actuator in spec.actuators)


def _name_all(spec: mujoco.MjSpec) -> None:
    """Give names to the elements that have none."""
    _name(spec.joints, lambda joint: joint.parent.name or "joint")
    _name(spec.tendons, lambda tendon: "tendon")
    _name(spec.actuators, lambda actuator: actuator.target or "actuator")
    _name(spec.sensors, lambda sensor: f"{sensor.objname or 'sensor'}_{int(sensor.type)}")


def _name(elements: Sequence[Any], base: Callable[[Any], str]) -> None:
    taken = {element.name for element in elements if element.name}
    for element in elements:
        if not element.name:
            element.name = _free(base(element), taken)


def _free(name: str, taken: set[str]) -> str:
    """Return the name, with a number if it is taken, and take it."""
    found, number = name, 1
    while found in taken:
        number += 1
        found = f"{name}_{number}"
    taken.add(found)
    return found
