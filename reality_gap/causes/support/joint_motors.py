"""Joint motors: actuators of joints with a linear force, and position servos among them."""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Location
from reality_gap.causes.support import actuators, elements, typical_scales
from reality_gap.study.system import System, commanded

_SIMPLE = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))


def is_motor(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether an actuator moves a hinge or slide with a force linear in its command."""
    if int(model.actuator_trntype[actuator]) not in actuators.JOINT_TRANSMISSIONS:
        return False
    joint = int(model.actuator_trnid[actuator, 0])
    fixed = int(model.actuator_gaintype[actuator]) == int(mujoco.mjtGain.mjGAIN_FIXED)
    simple = int(model.jnt_type[joint]) in _SIMPLE
    return simple and fixed and actuators.is_linear(model, actuator)


def is_servo(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether a joint motor feeds the position of its joint back."""
    return is_motor(model, actuator) and actuators.feeds_back(model, actuator)


def each_and_all(system: System, suits: elements.Suits) -> tuple[Location, ...]:
    """Return each suitable actuator and all of them; none where efforts replace the actuators."""
    if system.study.inverse:
        return ()
    return elements.each_actuator(system, suits) + elements.all_actuators(system, suits)


def joint_of(system: System, actuator: str) -> str:
    """Return the joint that an actuator moves."""
    return system.model.joint(int(system.model.actuator(actuator).trnid[0])).name


def motors_of(system: System, joint: str) -> tuple[str, ...]:
    """Return the names of the motors of a joint."""
    model = system.model
    names = (model.actuator(i).name for i in commanded(model) if is_motor(model, i))
    return tuple(name for name in names if joint_of(system, name) == joint)


def typical_speed(system: System, location: Location) -> tuple[str, float]:
    """Return the unit of position, m or rad, and the speed of the fastest of motors' joints."""
    joints = [Location("joint", (joint_of(system, name),)) for name in location.elements]
    unit = "m" if typical_scales.slides(system, joints[0].elements[0]) else "rad"
    return unit, max(typical_scales.joint_speed(system, joint) for joint in joints)


class MotorForce:
    """Force of a motor on its joint in the coming step, from the state before that step.

    ``actuator_force`` is that of the previous step, before which the command may have been another.
    """

    def __init__(self, model: mujoco.MjModel, motor: str, joint: str) -> None:
        self._index = i = int(model.actuator(motor).id)
        self._position = int(model.joint(joint).qposadr[0])
        self._dof = int(model.joint(joint).dofadr[0])
        self._drive = actuators.Drive(model, i)
        self._gear = float(model.actuator_gear[i, 0])
        affine = int(mujoco.mjtBias.mjBIAS_AFFINE)
        self._feeds = float(int(model.actuator_biastype[i]) == affine)
        self._limited = bool(model.actuator_forcelimited[i])

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> float:
        """Return the force behind the gear [N or N m]."""
        i, bias = self._index, model.actuator_biasprm
        force = float(model.actuator_gainprm[i, 0]) * self._drive(model, data)
        if self._feeds:
            force += bias[i, 0] + self._gear * (
                bias[i, 1] * data.qpos[self._position] + bias[i, 2] * data.qvel[self._dof]
            )
        if self._limited:
            low, high = model.actuator_forcerange[i]
            force = min(max(force, low), high)
        return float(self._gear * force)
