"""Muscle law: the tension of a muscle as a function of its length.

A motor pulls by muscle stiffness control (Kawaharazuka et al. 2018, sec. III-B),

    T = T_bias + max(0, K_stiff (l - l_target)),  cut at T_max,

where l is the length that the encoder reads and l_target the commanded one. MuJoCo computes it at
the physics rate by an affine actuator (`write_law`), and `motor_tension` computes it for readings.

A tendon that stretches by x > 0 pulls as a hardening spring, T = k1 x + k2 x^2 + k3 x^3, and does
not push (`spring_tension`).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.arguments import real_numbers
from kengoro_env.errors import ArgumentError
from kengoro_env.robot.indexing import Index
from kengoro_env.types import Floats

_NEWTON_STEPS = 30
"""Steps of Newton's method; they converge to rounding from zero stretch."""


@dataclass(frozen=True)
class Gains:
    """Gains of muscle stiffness control, the same for nominal model and actual robot.

    Attributes:
        stiffness: K_stiff [N/m].
        bias: T_bias, the tension that keeps a muscle from going slack [N].
        limit: T_max, the largest tension of a motor [N].
        damping: viscous friction of a motor, seen at the tendon [N s/m].

    Raises:
        ArgumentError: a value is negative or not finite.
    """

    stiffness: float = 30_000.0
    bias: float = 30.0
    limit: float = 500.0
    damping: float = 150.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            array = real_numbers(value)
            if array is None or not np.all(np.isfinite(array) & (array >= 0.0)):
                raise ArgumentError(
                    f"Gains: {field.name} must be a finite number that is not negative, got "
                    f"{value!r}"
                )


DEFAULT_GAINS = Gains()


def motor_tension(
    lengths: Floats,
    commands: Floats,
    velocities: Floats,
    gains: tuple[Floats, Floats, Floats],
    damping: Floats,
) -> Floats:
    """Tension of motors whose tendons do not stretch (..., m) [N], never negative.

    Args:
        lengths: lengths of the tendons (..., m) [m].
        commands: commanded lengths (..., m) [m]; the array is overwritten.
        velocities: rates of the lengths (..., m) [m/s]; the array is overwritten.
        gains: K_stiff (m,) [N/m], T_bias (m,) [N] and T_max (m,) [N].
        damping: viscous friction of the motors (m,) [N s/m].
    """
    stiffness, bias, limit = gains
    pull = commands
    np.subtract(lengths, pull, out=pull)
    pull *= stiffness
    pull += bias
    np.maximum(pull, bias, out=pull)
    np.minimum(pull, limit, out=pull)
    velocities *= damping
    pull += velocities
    return np.maximum(pull, np.zeros_like(bias), out=pull)


def spring_tension(stretch: Floats, polynomial: Floats) -> Floats:
    """Tension of tendons that stretch (..., m) [N]; 0 where they are slack.

    Args:
        stretch: elongation by tension (..., m) [m]; negative: slack.
        polynomial: k1, k2, k3 of each tendon (3, m) [N/m, N/m^2, N/m^3].
    """
    x = np.maximum(stretch, np.zeros(stretch.shape[-1]))
    k1, k2, k3 = polynomial
    pull: Floats = k3 * x
    pull += k2
    pull *= x
    pull += k1
    pull *= x
    return pull


def spring_stretch(tension: Floats, polynomial: Floats, stretches: NDArray[np.bool_]) -> Floats:
    """Stretch at a tension (m,) [m], the inverse of `spring_tension` by Newton's method.

    Args:
        tension: tensions (m,) [N].
        polynomial: as in `spring_tension`.
        stretches: which tendons stretch (m,); the result is 0 for the others.
    """
    x = np.zeros(len(stretches))
    k1, k2, k3 = polynomial
    for _ in range(_NEWTON_STEPS):
        slope = np.where(stretches, k1 + x * (2 * k2 + 3 * k3 * x), 1.0)
        x = np.where(stretches, x - (spring_tension(x, polynomial) - tension) / slope, 0.0)
    return x


def write_law(
    model: Any,
    actuators: Index,
    gains: tuple[Floats, Floats, float],
    sign: Floats,
    drum: Floats,
) -> None:
    """Write muscle stiffness control into the affine actuators of a model.

    Args:
        model: an `MjModel`.
        actuators: indices of the actuators, in the order of the muscles.
        gains: K_stiff (m,) [N/m], T_bias (m,) [N] and T_max [N].
        sign: sign of the actuator's force in a pull (m,): -1 on a tendon, 1 on a spool.
        drum: length paid out when the spool stands at zero (m,) [m]; 0 without a spool.
    """
    stiffness, bias, limit = gains
    low, high = np.sort([sign * bias, sign * limit], axis=0)
    model.actuator_gainprm[actuators, 0] = -sign * stiffness
    model.actuator_biasprm[actuators, 0] = sign * bias + np.where(sign > 0, stiffness * drum, 0.0)
    model.actuator_biasprm[actuators, 1] = -stiffness
    model.actuator_forcerange[actuators] = np.column_stack([low, high])


def add_affine_actuator(
    spec: mujoco.MjSpec, name: str, transmission: mujoco.mjtTrn, target: str
) -> None:
    """Add an actuator for `write_law` to a model that is not compiled yet."""
    actuator = spec.add_actuator(name=name, target=target, trntype=transmission)
    actuator.gaintype = mujoco.mjtGain.mjGAIN_FIXED
    actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    actuator.forcelimited = True
    actuator.forcerange = np.array([-1.0, 1.0])
