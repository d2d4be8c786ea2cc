"""Joint motors: actuators of joints with a linear force, and position servos among them."""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Location
from reality_gap.causes.support import actuators, elements
from reality_gap.study.system import System

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
    affine = int(model.actuator_biastype[actuator]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
    return is_motor(model, actuator) and affine and model.actuator_biasprm[actuator, 1] != 0.0


def is_damped(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether a position servo feeds the velocity of its joint back, too."""
    return is_servo(model, actuator) and model.actuator_biasprm[actuator, 2] != 0.0


def each_and_all(system: System, suits: elements.Suits) -> tuple[Location, ...]:
    """Return each suitable actuator and all of them; none where efforts replace the actuators."""
    if system.study.inverse:
        return ()
    return elements.each_actuator(system, suits) + elements.all_actuators(system, suits)


def joint_of(system: System, actuator: str) -> str:
    """Return the joint that an actuator moves."""
    return system.model.joint(int(system.model.actuator(actuator).trnid[0])).name
