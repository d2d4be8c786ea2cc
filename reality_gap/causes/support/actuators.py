"""Actuators: which of them causes can change, what drives them, what they pull."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from reality_gap.causes.base import Record
from reality_gap.study.system import ActuatedTendon
from reality_gap.types import Floats


def linear(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether its force is linear in ctrl, position and velocity."""
    gains = (int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE))
    biases = (int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE))
    gain, bias = int(model.actuator_gaintype[actuator]), int(model.actuator_biastype[actuator])
    return gain in gains and bias in biases


def pull(record: Record, tendon: ActuatedTendon) -> Floats:
    """Tension that a wire's actuator gives (k,) [N]."""
    i = record.model.actuator(tendon.actuator).id
    return -record.model.actuator_gear[i, 0] * record.force[:, i]


def at_limit(record: Record, tendon: ActuatedTendon) -> NDArray[np.bool_]:
    """When a wire's actuator gives all that it may, or as little (k,)."""
    i = record.model.actuator(tendon.actuator).id
    low, high = record.model.actuator_forcerange[i]
    force = record.force[:, i]
    return bool(record.model.actuator_forcelimited[i]) & ((force <= low) | (force >= high))
