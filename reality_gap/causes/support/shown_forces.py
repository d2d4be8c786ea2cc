"""Forces that a log shows: those of its sensors, those that plain motors were commanded, and those
of servos by how far their joints were from their commands.

A model without limits of forces says little of how strong a machine is: a light link that moves
slowly needs almost nothing, and may carry a load of any size.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import mujoco
import numpy as np

from reality_gap.causes.support import actuators
from reality_gap.causes.support.machine_size import MachineSize, machine_size
from reality_gap.study.data import Reading
from reality_gap.study.system import System, column, command_limits, commanded
from reality_gap.types import Floats

FOLLOWING = tuple(
    int(getattr(mujoco.mjtDyn, f"mjDYN_{kind}")) for kind in ("NONE", "FILTER", "FILTEREXACT")
)
"""Kinds of activation that follow the command."""

SPEED_PERIOD = 0.02
"""Interval over which a measured velocity is averaged [s]."""

_SENSOR, _TRANSMISSION = mujoco.mjtSensor, mujoco.mjtTrn


@lru_cache(maxsize=2)
def typical_loads(system: System) -> Floats:
    """Return the typical force of each degree of freedom, shape (nv,) [N m or N].

    It is that of the model, or where no limit of a motor tells it, the RMS of the largest force
    that the log shows, if that is more.
    """
    size, uses = machine_size(system), system.study.uses
    if size.limited.all():
        return size.load
    shown = np.zeros(system.model.nv)
    for joint, use in uses.items():
        shown[_dof(system.model, system.model.joint(joint).id)] = use.force
    shows = (_sensed, _commanded, _of_servos)
    for dof, force in () if uses else (pair for show in shows for pair in show(system, size)):
        shown[dof] = np.maximum(shown[dof], force)
    return np.where(size.limited, size.load, np.maximum(size.load, shown))


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
        direct = int(model.actuator_dyntype[i]) == int(mujoco.mjtDyn.mjDYN_NONE)
        at = column(model, model.actuator(i).name)
        commands = [e.command[:, at] for e in system.study.episodes if e.command.shape[1] > at]
        if direct and commands and actuators.has_constant_gain(model, i):
            gain = abs(float(model.actuator_gainprm[i, 0]))
            yield _of_actuator(model, size, i, gain * _rms(np.concatenate(commands)))


def _of_servos(system: System, size: MachineSize) -> Iterator[tuple[slice, Floats]]:
    """Yield degrees of freedom with the force on them of a servo whose joint was measured."""
    model = system.model
    for i in commanded(model):
        fixed = int(model.actuator_gaintype[i]) == int(mujoco.mjtGain.mjGAIN_FIXED)
        on_joint = int(model.actuator_trntype[i]) in actuators.JOINT_TRANSMISSIONS
        follows = int(model.actuator_dyntype[i]) in FOLLOWING
        if not (fixed and on_joint and follows and actuators.feeds_back(model, i)):
            continue
        forces = [
            _servo_force(model, i, command, reading)
            for command, reading in _motions(system, i, int(model.actuator_trnid[i, 0]))
        ]
        if forces:
            yield _of_actuator(model, size, i, _rms(np.concatenate(forces)))


def _motions(system: System, actuator: int, joint: int) -> Iterator[tuple[Floats, Reading]]:
    """Yield the commands of an actuator at the readings of a joint's position (k,), and these."""
    model, study = system.model, system.study
    at = column(model, model.actuator(actuator).name)
    for c, channel in enumerate(study.channels):
        if channel.kind != "sensor":
            continue
        sensor = model.sensor(channel.sensor)
        if int(sensor.type[0]) != int(_SENSOR.mjSENS_JOINTPOS) or int(sensor.objid[0]) != joint:
            continue
        for episode in study.episodes:
            if episode.command.shape[1] > at and c < len(episode.readings):
                reading = spaced(episode.readings[c])
                # A control loop reads first and then commands.
                row = np.maximum(np.searchsorted(episode.time, reading.time) - 1, 0)
                if len(reading.time) > 1:
                    yield episode.command[row, at], reading


def spaced(reading: Reading) -> Reading:
    """Return the readings of a position about `SPEED_PERIOD` apart.

    Noise is a small part of the velocities between these.
    """
    if len(reading.time) < 2:
        return reading
    period = (reading.time[-1] - reading.time[0]) / (len(reading.time) - 1)
    stride = max(1, round(SPEED_PERIOD / period))
    return Reading(reading.time[::stride], reading.value[::stride])


def _servo_force(model: mujoco.MjModel, actuator: int, command: Floats, reading: Reading) -> Floats:
    """Return the force of a servo before its gear at the readings of its joint (k,)."""
    gear = float(model.actuator_gear[actuator, 0])
    constant, by_length, by_speed = (float(x) for x in model.actuator_biasprm[actuator, :3])
    length, speed = gear * reading.value, gear * np.gradient(reading.value, reading.time)
    gain = float(model.actuator_gainprm[actuator, 0])
    command = np.clip(command, *command_limits(model, actuator))
    return gain * command + constant + by_length * length + by_speed * speed


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
    """Return the RMS of the values that are finite; 0 if there are none."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else 0.0
