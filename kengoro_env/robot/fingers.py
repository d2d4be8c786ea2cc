"""Fingers: one motor closes fingers and thumb.

A fixed tendon couples the four finger joints, so that a joint that meets resistance stops while
the others continue. Springs in the joints help to open the hand. Forces are limited to those of a
human hand.
"""

from __future__ import annotations

import mujoco
import numpy as np

from kengoro_env.names import FINGER_JOINTS

FINGERS = "fingers"
"""Name of the actuator of the fingers; its control is -1 for open and +1 for closed."""

_PULLEYS = (
    1.0,
    0.7,
    0.8,
    0.5,
)  # joint torque per motor torque, of `FINGER_JOINTS` [1]
_TORQUE = (-0.6, 1.2)  # limits of the motor [N m], for a grip of 20 to 30 N
_STIFFNESS = 2.0  # stiffness of the motor's position control [N m]
_CLOSED = 4.0  # target of the closed coupling, beyond a fist so that a grip keeps its force


def add_fingers(spec: mujoco.MjSpec) -> None:
    """Add coupling and motor of the fingers to a model; a model without fingers stays as it is."""
    if spec.joint(FINGER_JOINTS[0]) is None:
        return
    coupling = spec.add_tendon(name=FINGERS)
    for joint, pulley in zip(FINGER_JOINTS, _PULLEYS, strict=True):
        coupling.wrap_joint(joint, pulley)
    motor = spec.add_actuator(name=FINGERS, target=FINGERS, trntype=mujoco.mjtTrn.mjTRN_TENDON)
    motor.gaintype = mujoco.mjtGain.mjGAIN_FIXED
    motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    # Torque = stiffness (target - coupling), with the target 0 at -1 and _CLOSED at +1.
    motor.gainprm[0] = _STIFFNESS * _CLOSED / 2
    motor.biasprm[:2] = (_STIFFNESS * _CLOSED / 2, -_STIFFNESS)
    motor.forcelimited = True
    motor.forcerange = np.array(_TORQUE)
    motor.ctrllimited = True
    motor.ctrlrange = np.array([-1.0, 1.0])
