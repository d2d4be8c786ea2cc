"""Validation: checks names, numbers of columns and units of a study against its model."""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.errors import StudyError
from reality_gap.io.dimensions import actuator_units, joint_units, sensor_units
from reality_gap.io.schema import Line, StudyFile
from reality_gap.io.units import symbols_of
from reality_gap.io.yaml_reader import nearest
from reality_gap.study.system import commanded

_SIMPLE = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))


def check_against_model(file: StudyFile, model: mujoco.MjModel) -> None:
    """Raise `StudyError` for the first line of a study that does not fit its model."""
    _check_actuators(file, model)
    known = sensor_names(model)
    for name, line in file.sensors.items():
        _check_name(file, "sensor", name, known)
        _check_columns(file, f"sensor {name}", line, int(model.sensor(name).dim[0]))
        _check_unit(file, f"sensor {name}", line, sensor_units(model, name))
    if file.efforts:
        _check_efforts(file, model)
    initial = [file.joints or {}, *(files.joints for files in file.episodes)]
    for name in (name for joints in initial for name in joints):
        _check_name(file, "hinge or slide joint", name, simple_joints(model))
    if file.joints is None and not measured_joints(file, model):
        raise StudyError(
            f"{file.path}, initial.joints: first_reading needs a jointpos sensor in sensors; "
            "without one give positions, such as {elbow: 0.5}"
        )


def actuator_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Return the names of the model's actuators that take a command, in its order."""
    return tuple(model.actuator(i).name for i in commanded(model))


def sensor_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Return the names of the model's sensors, without those that have no name."""
    return tuple(n for n in (model.sensor(i).name for i in range(model.nsensor)) if n)


def simple_joints(model: mujoco.MjModel) -> tuple[str, ...]:
    """Return the names of hinge and slide joints."""
    return tuple(
        model.joint(i).name for i in range(model.njnt) if int(model.jnt_type[i]) in _SIMPLE
    )


def measured_joints(file: StudyFile, model: mujoco.MjModel) -> dict[str, str]:
    """Return the joint's name for each jointpos sensor of the study."""
    jointpos = int(mujoco.mjtSensor.mjSENS_JOINTPOS)
    return {
        name: model.joint(int(model.sensor(name).objid[0])).name
        for name in file.sensors
        if int(model.sensor(name).type[0]) == jointpos
    }


def _check_actuators(file: StudyFile, model: mujoco.MjModel) -> None:
    for i in np.flatnonzero(model.actuator_ctrlnum > 1) if file.actuators else ():
        raise StudyError(
            f"{file.path}: actuator {model.actuator(i).name!r} of the model takes "
            f"{model.actuator_ctrlnum[i]} inputs, but a study has one command for each actuator; "
            "keep one of its inputs in the model"
        )
    known = actuator_names(model)
    if file.actuators and not known:
        raise StudyError(
            f"{file.path}: the model {file.model.name} has no actuators; give efforts instead"
        )
    for name, line in file.actuators.items():
        _check_name(file, "actuator", name, known)
        _check_columns(file, f"actuator {name}", line, 1)
        _check_unit(file, f"actuator {name}", line, actuator_units(model, name))
    missing = [name or "one without a name" for name in known if name not in file.actuators]
    if missing and not file.efforts:
        raise StudyError(
            f"{file.path}: actuators must have a line for each actuator of the model that takes a "
            f"command, unless there are efforts; missing: {', '.join(missing)}"
        )


def _check_efforts(file: StudyFile, model: mujoco.MjModel) -> None:
    measured = measured_joints(file, model).values()
    for i in range(model.njnt):
        joint = model.joint(i).name
        if joint not in measured:
            raise StudyError(
                f"{file.path}: efforts need the motion of all joints, but "
                f"{joint or f'joint {i}'} has no jointpos sensor in sensors; add one"
            )
    for name, line in file.efforts.items():
        _check_name(file, "joint", name, simple_joints(model))
        _check_columns(file, f"effort {name}", line, 1)
        _check_unit(file, f"effort {name}", line, joint_units(model, name)[1:])


def _check_name(file: StudyFile, kind: str, name: str, known: tuple[str, ...]) -> None:
    if name not in known:
        raise StudyError(
            f"{file.path}: the model has no {kind} {name!r}; it has: {nearest(name, known)}"
        )


def _check_columns(file: StudyFile, what: str, line: Line, count: int) -> None:
    if len(line.columns) != count:
        raise StudyError(
            f"{file.path}: {what} has {count} component{'s' * (count > 1)} in the model, but "
            f"{len(line.columns)} column{'s' * (len(line.columns) > 1)} in the study"
        )


def _check_unit(file: StudyFile, what: str, line: Line, allowed: tuple[str, ...]) -> None:
    if allowed and line.unit.si not in allowed:
        valid = ", ".join(symbol for si in allowed for symbol in symbols_of(si))
        raise StudyError(
            f"{file.path}: {what} cannot be in {line.unit.symbol}; it can be in: {valid}"
        )
