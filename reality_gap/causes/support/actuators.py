"""Actuators: which ones have a linear force, and the tension that they exert."""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Record
from reality_gap.study.system import ActuatedTendon
from reality_gap.types import Bools, Floats

JOINT_TRANSMISSIONS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
"""Kinds of transmission of actuators that move a joint."""


def is_linear(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether an actuator's force is linear in ctrl, position and velocity."""
    gains = (int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE))
    biases = (int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE))
    gain, bias = int(model.actuator_gaintype[actuator]), int(model.actuator_biastype[actuator])
    return gain in gains and bias in biases


def feeds_back(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether an actuator's force depends on the position of what it moves."""
    affine = int(model.actuator_biastype[actuator]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
    return affine and model.actuator_biasprm[actuator, 1] != 0.0


def make_affine(actuator: mujoco.MjsActuator) -> None:
    """Give an actuator without bias an affine bias of 0."""
    if actuator.biastype == mujoco.mjtBias.mjBIAS_NONE:
        actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        actuator.biasprm[:] = 0.0


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
