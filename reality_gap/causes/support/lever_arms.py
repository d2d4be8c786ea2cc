"""Lengths of the drawing's wires at postures, and the joints that they cross."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from reality_gap.study.system import System
from reality_gap.types import Floats

PROBE = 0.1
"""How far a joint is moved to see which wires it pulls [rad or m]."""
SEEN = 1e-5
"""A length that changes by less does not depend on a joint [m]."""


def lengthening(system: System, joints: Mapping[str, float]) -> dict[str, float]:
    """Longer by how much each wire is at a posture than at ``qpos0`` [m].

    Args:
        system: whose model is asked.
        joints: how far from ``qpos0`` joints stand [rad or m]; the others stand there.
    """
    change = _tendon_lengths(system.model, joints) - system.model.tendon_length0
    return {w.name: float(change[system.model.tendon(w.name).id]) for w in system.tendons}


def actuated_joints(system: System) -> tuple[str, ...]:
    """Joints that change the length of a wire, in the order of the system's."""
    moved = _moved_tendons(system.model, system.joints)
    tendons = [system.model.tendon(w.name).id for w in system.tendons]
    return tuple(name for name, row in zip(system.joints, moved, strict=True) if row[tendons].any())


@lru_cache(maxsize=4)
def _moved_tendons(model: mujoco.MjModel, joints: tuple[str, ...]) -> NDArray[np.bool_]:
    """Whether each joint changes each tendon's length (joints, ntendon)."""
    changes = [
        [_tendon_lengths(model, {name: side * PROBE}) - model.tendon_length0 for side in (-1, 1)]
        for name in joints
    ]
    return np.abs(changes).max(axis=1) > SEEN if changes else np.zeros((0, 0), bool)


def _tendon_lengths(model: mujoco.MjModel, joints: Mapping[str, float]) -> Floats:
    data = mujoco.MjData(model)
    for name, offset in joints.items():
        data.qpos[model.joint(name).qposadr[0]] += offset
    mujoco.mj_fwdPosition(model, data)
    return data.ten_length


def lever_arms(system: System, tendon: str) -> dict[str, float]:
    """Lengthening of a wire by each joint [m/rad or 1], in the middle of the joints' ranges."""
    model, index = system.model, system.model.tendon(tendon).id
    middle = {name: _middle(model, name) for name in system.joints}
    arms = {}
    for name in actuated_joints(system):
        far, near = (
            _tendon_lengths(model, middle | {name: middle[name] + side * PROBE})[index]
            for side in (0.5, -0.5)
        )
        arms[name] = float(far - near) / PROBE
    return arms


def _middle(model: mujoco.MjModel, joint: str) -> float:
    """Of a joint's range, from ``qpos0``."""
    found = model.joint(joint)
    return float(found.range.mean() - found.qpos0[0]) if found.limited[0] else 0.0
