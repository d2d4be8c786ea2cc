"""Lever arms: nominal lengths of tendons at postures, and the joints that tendons cross."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import mujoco
import numpy as np

from reality_gap.study.system import System
from reality_gap.types import Bools, Floats

PROBE = 0.1
"""Displacement of a joint to find the tendons that cross it [rad or m]."""
NEGLIGIBLE = 1e-5
"""Largest change of length of a tendon that does not cross a joint [m]."""


def lengthening(system: System, joints: Mapping[str, float]) -> dict[str, float]:
    """Return by how much each tendon is longer at a posture than at ``qpos0`` [m].

    Args:
        system: the machine.
        joints: displacements of joints from ``qpos0`` [rad or m]; the others are at ``qpos0``.
    """
    change = _tendon_lengths(system.model, joints) - system.model.tendon_length0
    return {t.name: float(change[system.model.tendon(t.name).id]) for t in system.tendons}


def actuated_joints(system: System) -> tuple[str, ...]:
    """Return the joints that actuated tendons cross, in the order of the system's joints."""
    crossed = _crossed_tendons(system.model, system.joints)
    ids = [system.model.tendon(t.name).id for t in system.tendons]
    return tuple(name for name, row in zip(system.joints, crossed, strict=True) if row[ids].any())


def lever_arms(system: System, tendon: str) -> dict[str, float]:
    """Return a tendon's lever arm at each joint, in the middle of the joints' ranges [m/rad or 1].

    A positive lever arm means that the tendon becomes longer if the joint's position increases.
    """
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


@lru_cache(maxsize=4)
def _crossed_tendons(model: mujoco.MjModel, joints: tuple[str, ...]) -> Bools:
    """Return whether each joint changes each tendon's length, shape (joints, ntendon)."""
    changes = [
        [_tendon_lengths(model, {name: side * PROBE}) - model.tendon_length0 for side in (-1, 1)]
        for name in joints
    ]
    return np.abs(changes).max(axis=1) > NEGLIGIBLE if changes else np.zeros((0, 0), bool)


def _tendon_lengths(model: mujoco.MjModel, joints: Mapping[str, float]) -> Floats:
    """Return the lengths of all tendons with joints displaced from ``qpos0``, (ntendon,) [m]."""
    data = mujoco.MjData(model)
    for name, offset in joints.items():
        data.qpos[model.joint(name).qposadr[0]] += offset
    mujoco.mj_fwdPosition(model, data)
    return data.ten_length


def _middle(model: mujoco.MjModel, joint: str) -> float:
    """Return the middle of a joint's range relative to ``qpos0``; 0 without limits."""
    found = model.joint(joint)
    return float(found.range.mean() - found.qpos0[0]) if found.limited[0] else 0.0
