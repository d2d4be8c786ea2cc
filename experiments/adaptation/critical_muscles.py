"""Which wires matter most: by the drawing alone, without moving a robot.

Under stiffness control, T = T_bias + max(0, K (l - l_target)), the drawn arm rests where its wires'
pull and gravity balance. A wire that gives for good pulls as if its target were that much longer.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from jmm_agent.types import Floats
from kengoro.trained_maps import ARM
from kengoro_env.assets import asset_path
from kengoro_env.postures import posture_set
from kengoro_env.robot.motors import DEFAULT_GAINS
from kengoro_env.robot.nominal_model import NominalArm

POSTURES = 5
"""Postures of the set over which the effect is taken."""

STEPS = 60
LARGEST_STEP = 0.1  # [rad]
HOLD = 1.0  # [N m/rad] keeps joints that no wire holds
ENOUGH = 1e-4  # [rad]


@cache
def critical_muscles(count: int, length: float) -> tuple[str, ...]:
    """The wires that move the drawn arm most if they give, the worst first.

    The first moves it most by itself, the second most together with the first, and so on.

    Args:
        count: how many.
        length: by how much each gives [m].
    """
    arm = _arm()
    chosen: list[str] = []
    for _ in range(count):
        left = [muscle for muscle in arm.muscles if muscle not in chosen]
        chosen.append(max(left, key=lambda muscle: effect_deg((*chosen, muscle), length)))
    return tuple(chosen)


@cache
def effect_deg(muscles: tuple[str, ...], length: float) -> float:
    """RMS over joints and postures [deg] by which the drawn arm moves if wires give by ``length``
    [m]."""
    arm = _arm()
    given = length * np.isin(arm.muscles, muscles)
    moved = [rest(arm, arm.lengths(q)[0] + given, here) - here for q, here in _rests()]
    return float(np.degrees(np.sqrt(np.mean(np.square(moved)))))


@cache
def _arm() -> NominalArm:
    return NominalArm(asset_path(ARM))


@cache
def _rests() -> tuple[tuple[Floats, Floats], ...]:
    """Postures and where the drawn arm rests when sent there, (n,) [rad] each."""
    arm, postures = _arm(), posture_set()
    chosen = postures[np.random.default_rng(0).permutation(len(postures))[:POSTURES]]
    return tuple((q, rest(arm, arm.lengths(q)[0], q)) for q in chosen)


def rest(arm: NominalArm, target: Floats, start: Floats) -> Floats:
    """Joint angles (n,) [rad] inside the limits at which pull and gravity balance.

    Args:
        arm: the drawing.
        target: lengths that the motors hold (m,) [m].
        start: joint angles (n,) [rad] to search from.
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
