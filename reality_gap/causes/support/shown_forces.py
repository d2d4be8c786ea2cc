"""Forces that a log shows: those of its sensors, and those that plain motors were commanded.

A model without limits of forces says little of how strong a machine is: a light link that moves
slowly needs almost nothing, and may carry a load of any size.
"""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from reality_gap.causes.support import actuators
from reality_gap.causes.support.machine_size import MachineSize, machine_size
from reality_gap.study.system import System, column, commanded
from reality_gap.types import Floats

_SENSOR, _TRANSMISSION = mujoco.mjtSensor, mujoco.mjtTrn


def typical_loads(system: System) -> Floats:
    """Return the typical force of each degree of freedom, shape (nv,) [N m or N].

    It is that of the model, or where no limit of a motor tells it, the RMS of the largest force
    that the log shows, if that is more.
    """
    size = machine_size(system)
    unlimited = size.rated == 0.0
    if not unlimited.any():
        return size.load
    shown = np.zeros(system.model.nv)
    for dof, force in (*_sensed(system, size), *_commanded(system, size)):
        shown[dof] = np.maximum(shown[dof], force)
    return np.where(unlimited, np.maximum(size.load, shown), size.load)


def _sensed(system: System, size: MachineSize) -> Iterator[tuple[slice, Floats]]:
    """Yield degrees of freedom with the force on them that a sensor measured, shape (k,)."""
    model, study = system.model, system.study
    for c, channel in enumerate(study.channels):
        readings = [e.readings[c].value for e in study.episodes if e.readings]
        if channel.kind != "sensor" or not any(map(len, readings)):
            continue
        sensor = model.sensor(channel.sensor)
        kind, target = int(sensor.type[0]), int(sensor.objid[0])
        force = _rms(np.concatenate(readings))
        if kind == int(_SENSOR.mjSENS_ACTUATORFRC):
            yield _of_actuator(model, size, target, force)
        elif kind == int(_SENSOR.mjSENS_TENDONACTFRC):
            yield slice(None), force * size.arms[target]
        elif kind == int(_SENSOR.mjSENS_JOINTACTFRC):
            yield _dof(model, target), np.array([force])


def _commanded(system: System, size: MachineSize) -> Iterator[tuple[slice, Floats]]:
    """Yield degrees of freedom with the force on them that a plain motor was commanded."""
    model = system.model
    for i in commanded(model):
        fixed = int(model.actuator_gaintype[i]) == int(mujoco.mjtGain.mjGAIN_FIXED)
        plain = int(model.actuator_biastype[i]) == int(mujoco.mjtBias.mjBIAS_NONE)
        at = column(model, model.actuator(i).name)
        commands = [e.command[:, at] for e in system.study.episodes]
        if fixed and plain and any(map(len, commands)):
            gain = abs(float(model.actuator_gainprm[i, 0]))
            yield _of_actuator(model, size, i, gain * _rms(np.concatenate(commands)))


def _of_actuator(
    model: mujoco.MjModel, size: MachineSize, actuator: int, force: float
) -> tuple[slice, Floats]:
    """Return degrees of freedom with the force on them of an actuator's force before its gear."""
    kind, target = int(model.actuator_trntype[actuator]), int(model.actuator_trnid[actuator, 0])
    force *= abs(float(model.actuator_gear[actuator, 0]))
    if kind == int(_TRANSMISSION.mjTRN_TENDON):
        return slice(None), force * size.arms[target]
    if kind in actuators.JOINT_TRANSMISSIONS:
        return _dof(model, target), np.array([force])
    return slice(0), np.zeros(0)


def _dof(model: mujoco.MjModel, joint: int) -> slice:
    at = int(model.jnt_dofadr[joint])
    return slice(at, at + 1)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
