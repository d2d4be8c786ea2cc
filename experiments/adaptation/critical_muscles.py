"""Critical muscles: those whose elongation moves the nominal arm most.

They are computed from the nominal model without moving a robot. Under stiffness control,
T = T_bias + max(0, K (l - l_target)), the arm rests where muscle torques and gravity balance:

    g(q) = J(q)^T T    with moment arms J = dl/dq.

A permanent elongation of a muscle has the same effect as a target length that is longer by it.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from jmm_agent.types import Floats
from kengoro.trained_maps import ARM
from kengoro_env.assets import asset_path
from kengoro_env.postures import posture_set
from kengoro_env.robot.muscle_law import DEFAULT_GAINS
from kengoro_env.robot.nominal_model import NominalArm

POSTURES = 5
"""Number of postures over which the effect is averaged."""
STEPS = 60
"""Largest number of Newton steps."""
LARGEST_STEP = 0.1
"""Largest change of a joint angle in a step [rad]."""
HOLD = 1.0
"""Stiffness added for joints that no muscle holds [N m/rad]."""
ENOUGH = 1e-4
"""Step at which the iteration ends [rad]."""


@cache
def critical_muscles(count: int, length: float) -> tuple[str, ...]:
    """Muscles whose elongation moves the nominal arm most, in the order of a greedy choice.

    The first muscle has the largest effect alone, the second the largest together with the first.

    Args:
        count: number of muscles.
        length: elongation of each [m].
    """
    arm = _arm()
    chosen: list[str] = []
    for _ in range(count):
        others = [muscle for muscle in arm.muscles if muscle not in chosen]
        chosen.append(max(others, key=lambda muscle: effect_deg((*chosen, muscle), length)))
    return tuple(chosen)


@cache
def effect_deg(muscles: tuple[str, ...], length: float) -> float:
    """RMS over joints and postures of the movement of the nominal arm [deg].

    Args:
        muscles: those that elongate.
        length: elongation of each [m].
    """
    arm = _arm()
    elongation = length * np.isin(arm.muscles, muscles)
    moved = [rest(arm, arm.lengths(q)[0] + elongation, here) - here for q, here in _rests()]
    return float(np.degrees(np.sqrt(np.mean(np.square(moved)))))


@cache
def _arm() -> NominalArm:
    return NominalArm(asset_path(ARM))


@cache
def _rests() -> tuple[tuple[Floats, Floats], ...]:
    """Commanded postures and those at which the nominal arm rests, shape (n,) [rad] each."""
    arm, postures = _arm(), posture_set()
    chosen = postures[np.random.default_rng(0).permutation(len(postures))[:POSTURES]]
    return tuple((q, rest(arm, arm.lengths(q)[0], q)) for q in chosen)


def rest(arm: NominalArm, target: Floats, start: Floats) -> Floats:
    """Joint angles within the limits at which muscle torques and gravity balance.

    Args:
        arm: nominal model.
        target: target lengths of the motors, shape (m,) [m].
        start: initial joint angles of the search, shape (n,) [rad].

    Returns:
        Joint angles, shape (n,) [rad].
    """
    gains, q = DEFAULT_GAINS, start
    for _ in range(STEPS):
        excess = arm.lengths(q)[0] - target
        arms = arm.moment_arms(q)
        tension = gains.bias + gains.stiffness * np.maximum(0.0, excess)
        pulling = arms[excess > 0.0]
        stiffness = gains.stiffness * pulling.T @ pulling + HOLD * np.eye(len(q))
        step = np.linalg.solve(stiffness, arm.gravity(q) - arms.T @ tension)
        there = np.clip(q + np.clip(step, -LARGEST_STEP, LARGEST_STEP), arm.lower, arm.upper)
        moved, q = np.abs(there - q).max(), there
        if moved < ENOUGH:
            break
    return q
