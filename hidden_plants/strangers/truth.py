"""True size of a hidden effect, with the mismatch of the machine that acts in the same way."""

from __future__ import annotations

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.mechanisms import build, motor_limits
from hidden_plants.strangers.mechanisms.mechanism import index_of, joint_of, size_of
from hidden_plants.strangers.mismatch import Mismatch, sample_mismatch
from hidden_plants.strangers.plant import Plant, real_step
from hidden_plants.strangers.stranger import Stranger

PLAIN = (
    "armature",
    "less_damping",
    "less_friction",
    "less_stiffness",
    "link_mass",
    "servo_kp",
    "servo_kd",
    "joint_offset",
    "encoder_scale",
    "length_scale",
    "length_offset",
    "force_scale",
    "force_offset",
    "torque_limit",
    "gravity_compensation",
    "payload",
    "command_delay",
    "sensor_delay",
    "reading_zero",
    "reading_scale",
    "backlash",
    "wire_elongation",
    "joint_stiffness",
    "torque_speed_curve",
    "speed_limit",
    "dead_zone",
    "gear_friction",
    "joint_elasticity",
    "motor_coupling",
    "clock_drift",
    "early_stamps",
)
"""Effects with one number that means the same to everybody."""


def true_size(stranger: Stranger, effect: Effect, mismatch: Mismatch | None = None) -> float | None:
    """Difference of the real machine from the nominal one by an effect and its mismatch.

    A reduction of a number of the model is negative; a limit of a force is the limit itself, that
    of a speed is its inverse.

    Args:
        stranger: nominal machine.
        effect: a hidden effect.
        mismatch: of the real machine; those of its seed by default.

    Returns:
        The difference in SI units; None for an effect whose size has more than one definition.
    """
    if effect.id not in PLAIN:
        return None
    if effect.id in motor_limits.TRUE_SIZES:
        return motor_limits.TRUE_SIZES[effect.id](effect)
    real = sample_mismatch(stranger) if mismatch is None else mismatch
    plant = build(stranger, real, (effect,), real_step(stranger))
    if effect.id in _OF_JOINTS:
        return _of_joint(stranger, plant, effect)
    if effect.id in ("servo_kp", "servo_kd", "torque_limit") and len(effect.elements) == 1:
        return _of_drive(stranger, plant, effect)
    if effect.id == "link_mass":
        body = stranger.model.body(effect.elements[0]).id
        return float(plant.model.body_mass[body] - stranger.model.body_mass[body])
    return size_of(effect)


_OF_JOINTS = {
    "armature": "dof_armature",
    "less_damping": "dof_damping",
    "less_friction": "dof_frictionloss",
    "less_stiffness": "jnt_stiffness",
}
"""Field of MuJoCo's model by effect."""


def _of_joint(stranger: Stranger, plant: Plant, effect: Effect) -> float:
    i, field = joint_of(plant, effect.elements[0]), _OF_JOINTS[effect.id]
    real, nominal = (np.ravel(getattr(m, field))[i] for m in (plant.model, stranger.model))
    return float(real - nominal)


def _of_drive(stranger: Stranger, plant: Plant, effect: Effect) -> float:
    i = index_of(plant, effect.elements[0])
    if effect.id == "torque_limit":
        return float(plant.law.high[i])
    name = {"servo_kp": "position", "servo_kd": "rate"}[effect.id]
    return float(getattr(plant.law, name)[i] / getattr(stranger.law, name)[i] - 1.0)
