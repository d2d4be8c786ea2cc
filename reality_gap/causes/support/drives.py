"""Drives: motors and position servos, of joints or of tendons, with a linear force."""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Location
from reality_gap.causes.support import actuators, elements, joint_motors, typical_scales
from reality_gap.study.system import System

OF_TENDON = "of a tendon"
"""Note of a location whose drives move tendons."""

_TENDON = int(mujoco.mjtTrn.mjTRN_TENDON)


def is_drive(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether an actuator moves a joint or tendon with a force linear in its command."""
    return joint_motors.is_motor(model, actuator) or _pulls(model, actuator)


def is_servo(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether a drive feeds the position of its joint, or its tendon's length, back."""
    return is_drive(model, actuator) and actuators.feeds_back(model, actuator)


def is_damped(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether a position servo feeds the velocity back, too."""
    return is_servo(model, actuator) and model.actuator_biasprm[actuator, 2] != 0.0


def each_and_all(system: System, suits: elements.Suits) -> tuple[Location, ...]:
    """Return each suitable drive and all of them, first those of joints and then of tendons.

    There are none where efforts replace the actuators.
    """

    def of_tendon(model: mujoco.MjModel, actuator: int) -> bool:
        return _pulls(model, actuator) and suits(model, actuator)

    def of_joint(model: mujoco.MjModel, actuator: int) -> bool:
        return not _pulls(model, actuator) and suits(model, actuator)

    tendons = joint_motors.each_and_all(system, of_tendon)
    noted = tuple(Location(one.kind, one.elements, OF_TENDON) for one in tendons)
    return joint_motors.each_and_all(system, of_joint) + noted


def typical_speed(system: System, location: Location) -> tuple[str, float]:
    """Return the unit of position, m or rad, and the speed of the fastest of drives' elements."""
    if location.note != OF_TENDON:
        return joint_motors.typical_speed(system, location)
    tendons = (_tendon(system, name) for name in location.elements)
    return "m", max(typical_scales.own_tendon_speed(system, tendon) for tendon in tendons)


def typical_travel(system: System, location: Location) -> tuple[str, float]:
    """Return the unit of position, m or rad, and the least motion of drives' elements."""
    if location.note == OF_TENDON:
        tendons = (_tendon(system, name) for name in location.elements)
        return "m", min(typical_scales.own_tendon_travel(system, tendon) for tendon in tendons)
    joints = (joint_motors.joint_of(system, name) for name in location.elements)
    travels = [typical_scales.joint_travel(system, Location("joint", (name,))) for name in joints]
    return min(travels, key=lambda found: found[::-1])


class Motion:
    """Position and velocity of a drive, behind its gear, before a physics step.

    Those of a tendon follow from its length and lever arms in the step before.
    """

    def __init__(self, model: mujoco.MjModel, actuator: str) -> None:
        self._index = i = int(model.actuator(actuator).id)
        self._gear, self._step = float(model.actuator_gear[i, 0]), float(model.opt.timestep)
        self._pulls, self._fresh, element = _pulls(model, i), False, int(model.actuator_trnid[i, 0])
        if self._pulls:
            start = int(model.ten_J_rowadr[element])
            self._row = slice(start, start + int(model.ten_J_rownnz[element]))
            self._dofs = model.ten_J_colind[self._row]
        else:
            self._position = int(model.jnt_qposadr[element])
            self._dof = int(model.jnt_dofadr[element])

    def position(self, model: mujoco.MjModel, data: mujoco.MjData) -> float:
        """Return the position times the gear [m or rad]."""
        if not self._pulls:
            return float(self._gear * data.qpos[self._position])
        if not self._fresh:
            mujoco.mj_fwdPosition(model, data)
            self._fresh = True
            return float(data.actuator_length[self._index])
        return float(data.actuator_length[self._index] + self._step * self.velocity(data))

    def velocity(self, data: mujoco.MjData) -> float:
        """Return the velocity times the gear [m/s or rad/s]."""
        if self._pulls:
            return float(self._gear * (data.ten_J[self._row] @ data.qvel[self._dofs]))
        return float(self._gear * data.qvel[self._dof])


def _pulls(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether an actuator moves a tendon with a force linear in its command."""
    fixed = int(model.actuator_gaintype[actuator]) == int(mujoco.mjtGain.mjGAIN_FIXED)
    tendon = int(model.actuator_trntype[actuator]) == _TENDON
    return tendon and fixed and actuators.is_linear(model, actuator)


def _tendon(system: System, actuator: str) -> str:
    """Return the tendon that an actuator moves."""
    return system.model.tendon(int(system.model.actuator(actuator).trnid[0])).name
