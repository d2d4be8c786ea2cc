"""Lever arms: nominal lengths of tendons at postures, and the joints that tendons cross."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from reality_gap.causes.support import machine_size
from reality_gap.study.system import System
from reality_gap.types import Floats

PROBE = 0.1
"""Displacement of a joint to find the lever arms of its tendons, over half of its range."""
NEGLIGIBLE = 1e-4
"""Largest change of length of a tendon that does not cross a joint, over the travel of tendons."""


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
    size = machine_size.machine_size(system)
    ids = [system.model.tendon(t.name).id for t in system.tendons]
    if not ids:
        return ()
    moved = size.arms[ids].max(axis=0) * size.travel
    least = NEGLIGIBLE * float(np.median(size.tendon_travel[ids]))
    return tuple(name for name in system.joints if moved[machine_size.dof(system, name)] > least)


def lever_arms(system: System, tendon: str) -> dict[str, float]:
    """Return a tendon's lever arm at each joint, in the middle of the joints' ranges [m/rad or 1].

    A positive lever arm means that the tendon becomes longer if the joint's position increases.
    """
    model, index = system.model, system.model.tendon(tendon).id
    travel = machine_size.machine_size(system).travel
    middle = {name: _middle(model, name) for name in system.joints}
    arms = {}
    for name in actuated_joints(system):
        step = PROBE * float(travel[machine_size.dof(system, name)])
        far, near = (
            _tendon_lengths(model, middle | {name: middle[name] + side * step})[index]
            for side in (0.5, -0.5)
        )
        arms[name] = float(far - near) / step
    return arms


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
