"""Commanded motions of the whole arm: between postures in front of the body, all tendons taut."""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear

from hidden_plants.machine import BIAS, STIFFNESS, Machine
from hidden_plants.types import Floats

HOME = {"sh_pitch": -35.0, "sh_roll": -20.0, "elbow": 75.0, "sc_roll": -10.0, "ac_roll": -4.0}
"""Posture at which every episode of the arm begins [deg]; the other joints are at zero."""
REACH = {
    "neck_yaw": 20.0,
    "neck_pitch": 10.0,
    "neck_roll": 8.0,
    "sc_roll": 8.0,
    "sc_yaw": 9.0,
    "ac_roll": 7.0,
    "ac_pitch": 7.0,
    "sh_pitch": 22.0,
    "sh_roll": 14.0,
    "sh_yaw": 22.0,
    "elbow": 28.0,
    "radioulnar": 30.0,
    "wrist_flex": 22.0,
    "wrist_dev": 9.0,
}
"""Largest distance of a posture from `HOME` in each joint [deg]."""
LEAST, MOST = 50.0, 330.0
"""Bounds of the planned tensions [N]."""
PREFERRED = (70.0, 160.0)
"""Range of the preferred tensions [N]; planned tensions differ to balance gravity."""
BALANCE_PERIOD = 10
"""Commands between two computations of balanced tensions, which are interpolated."""


def arm_episodes(
    machine: Machine, motion: int, count: int, rows: int
) -> list[tuple[Floats, Floats]]:
    """Plan episodes: initial posture (joints,) [rad] and target lengths (rows, tendons) [m]."""
    home = _angles(machine, HOME)
    return [
        (home, _targets(machine, np.random.default_rng([motion, k, 12]), home, rows))
        for k in range(count)
    ]


def _angles(machine: Machine, degrees: dict[str, float]) -> Floats:
    return np.deg2rad([degrees.get(joint, 0.0) for joint in machine.joints])


def _targets(machine: Machine, rng: np.random.Generator, home: Floats, rows: int) -> Floats:
    """Target lengths of a motion over three or four postures, with a short hold at each."""
    stops = int(rng.integers(3, 5))
    postures = [home] + [_posture(machine, rng, home) for _ in range(stops)]
    preferred = rng.uniform(*PREFERRED, (stops + 1, len(machine.tendons)))
    share = np.linspace(0.0, stops + 0.35, rows)
    path = _eased(share, np.array(postures))
    tensions = _eased(share, preferred)
    coarse = np.unique(np.append(np.arange(0, rows, BALANCE_PERIOD), rows - 1))
    held = _balance(machine, path[coarse], tensions[coarse])[0]
    tension = np.stack([np.interp(np.arange(rows), coarse, column) for column in held.T], axis=1)
    return machine.lengths(path) - (tension - BIAS) / STIFFNESS


def _eased(share: Floats, stops: Floats) -> Floats:
    """Interpolate between stops; stop k is reached at ``share`` k and held until k + 0.35."""
    index = np.minimum(share.astype(int), len(stops) - 2)
    part = np.clip((share - index - 0.35) / 0.65, 0.0, 1.0)
    part = np.where(share >= len(stops) - 1, 1.0, part)
    ease = (part**3 * (10.0 - 15.0 * part + 6.0 * part**2))[:, None]
    result: Floats = stops[index] * (1.0 - ease) + stops[index + 1] * ease
    return result


def _posture(machine: Machine, rng: np.random.Generator, home: Floats) -> Floats:
    """A random posture that the tendons can hold against gravity within their tensions."""
    reach = _angles(machine, REACH)
    for _ in range(50):
        posture = home + reach * rng.uniform(-1.0, 1.0, len(home))
        preferred = np.full((1, len(machine.tendons)), float(np.mean(PREFERRED)))
        if _balance(machine, posture[None], preferred)[1] < 0.1:
            return posture
    raise ValueError("no posture near home can be held by the tendons of this model")


def _balance(machine: Machine, postures: Floats, preferred: Floats) -> tuple[Floats, float]:
    """Tensions nearest to the preferred ones that hold postures.

    Args:
        machine: nominal model.
        postures: (k, joints) [rad].
        preferred: tensions (k, tendons) [N].

    Returns:
        Tensions (k, tendons) [N] and the largest torque that remains unbalanced [N m].
    """
    weight, held, lack = 100.0, np.empty_like(preferred), 0.0
    arms, needs = -machine.moment_arms(postures), machine.gravity_torques(postures)
    for tension, arm, need, wanted in zip(held, arms, needs, preferred, strict=True):
        matrix = np.vstack([weight * arm.T, 0.01 * np.eye(len(wanted))])
        goal = np.concatenate([weight * need, 0.01 * wanted])
        tension[:] = lsq_linear(matrix, goal, (LEAST, MOST), method="bvls").x
        lack = max(lack, float(np.abs(arm.T @ tension - need).max()))
    return held, lack
