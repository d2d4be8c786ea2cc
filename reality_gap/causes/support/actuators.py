"""Actuators: which ones have a linear force, and the tension that they exert."""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Record
from reality_gap.study.system import ActuatedTendon, command_limits
from reality_gap.types import Bools, Floats

JOINT_TRANSMISSIONS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
"""Kinds of transmission of actuators that move a joint."""


def moved_joint(model: mujoco.MjModel, actuator: str) -> str:
    """Return the name of the joint that an actuator moves; empty if it moves something else."""
    found = model.actuator(actuator)
    if int(found.trntype[0]) not in JOINT_TRANSMISSIONS:
        return ""
    return str(model.joint(int(found.trnid[0])).name)


def is_linear(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether an actuator's force is linear in ctrl, position and velocity."""
    gains = (int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE))
    biases = (int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE))
    gain, bias = int(model.actuator_gaintype[actuator]), int(model.actuator_biastype[actuator])
    return gain in gains and bias in biases


def is_muscle(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether an actuator is a muscle, whose force is a multiple of its peak force."""
    gain, bias = int(model.actuator_gaintype[actuator]), int(model.actuator_biastype[actuator])
    return gain == int(mujoco.mjtGain.mjGAIN_MUSCLE) and bias == int(mujoco.mjtBias.mjBIAS_MUSCLE)


def scale_force(actuator: mujoco.MjsActuator, factor: float) -> None:
    """Multiply all forces of a linear actuator or of a muscle."""
    if actuator.gaintype != mujoco.mjtGain.mjGAIN_MUSCLE:
        parts = slice(0, 3)
    else:  # The peak force is given, or follows from a scale if it is negative.
        parts = slice(2, 3) if actuator.gainprm[2] >= 0.0 else slice(3, 4)
    actuator.gainprm[parts] *= factor
    actuator.biasprm[parts] *= factor
    actuator.forcerange *= factor


def has_constant_gain(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether an actuator's force is its activation or command times a constant."""
    fixed = int(model.actuator_gaintype[actuator]) == int(mujoco.mjtGain.mjGAIN_FIXED)
    return fixed and int(model.actuator_biastype[actuator]) == int(mujoco.mjtBias.mjBIAS_NONE)


def feeds_back(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether an actuator's force depends on the position of what it moves."""
    affine = int(model.actuator_biastype[actuator]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
    return affine and model.actuator_biasprm[actuator, 1] != 0.0


def make_affine(actuator: mujoco.MjsActuator) -> None:
    """Give an actuator without bias an affine bias of 0."""
    if actuator.biastype == mujoco.mjtBias.mjBIAS_NONE:
        actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        actuator.biasprm[:] = 0.0


class Drive:
    """What the gain of an actuator multiplies: its activation, or its command as it acts.

    MuJoCo delays and limits commands in a step and leaves ``ctrl`` as it is.
    """

    def __init__(self, model: mujoco.MjModel, actuator: int) -> None:
        self._index, self._input = actuator, int(model.actuator_ctrladr[actuator])
        self._act = int(model.actuator_actadr[actuator])
        self._history = [int(x) for x in model.actuator_history[actuator]]
        self._low, self._high = command_limits(model, actuator)

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> float:
        """Return it for the coming step."""
        if self._act >= 0:
            return float(data.act[self._act])
        samples, interpolation = self._history
        command = data.ctrl[self._input]
        if samples:
            room = np.zeros((1, 1))
            read = mujoco.mj_readCtrl(model, data, self._index, data.time, room, interpolation)
            command = read.item()
        return min(max(float(command), self._low), self._high)


def pull(record: Record, tendon: ActuatedTendon) -> Floats:
    """Return the tension that a tendon's actuator exerts, shape (k,) [N]."""
    i = record.model.actuator(tendon.actuator).id
    return -record.model.actuator_gear[i, 0] * record.force[:, i]


def at_limit(record: Record, tendon: ActuatedTendon) -> Bools:
    """Return when the force of a tendon's actuator is at a limit, shape (k,)."""
    i = record.model.actuator(tendon.actuator).id
    low, high = record.model.actuator_forcerange[i]
    force = record.force[:, i]
    return bool(record.model.actuator_forcelimited[i]) & ((force <= low) | (force >= high))
