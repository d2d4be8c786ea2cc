"""Effects of named parameters that cannot be compared with the truth directly.

A moved site is evaluated by the lengths of tendons, friction around bends by its share of the
tension.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from hidden_plants import Truth
from hidden_plants.machine import Machine, load
from jmm_agent.types import Floats
from reality_gap import Diagnosis
from reality_gap.causes.load_dependent_friction import CAPSTAN, total_bend

ID = "attachment_shift"
POSTURES = 200
"""Largest number of postures of the log at which lengths are compared."""


def length_error(truth: Truth, found: Diagnosis, assets: Path) -> float | None:
    """Largest RMS error over tendons of the length over the postures of the log [m].

    Lengths are relative to those at ``qpos0``, where encoders are zeroed. None unless a site was
    moved and a moved site was named.
    """
    true = {
        site: np.array([e.parameters[axis] for axis in "xyz"])
        for e in truth.secret.effects
        if e.id == ID
        for site in e.elements
    }
    named: dict[str, Floats] = {}
    for cause in found.causes:
        if cause.candidate.cause.id == ID:
            value = {name: e.value for name, e in cause.parameters.items()}
            for site in cause.candidate.location.elements:
                single = "x" in value
                names = [axis if single else f"{site}.{axis}" for axis in "xyz"]
                named[site] = np.array([value[name] for name in names])
    if not true or not named:
        return None
    machine, postures = load(truth.machine, assets), _postures(truth)
    gap = _lengths(machine, postures, true) - _lengths(machine, postures, named)
    return float(np.sqrt(np.mean(gap**2, axis=0)).max())


def bend(truth: Truth, found: Diagnosis, assets: Path) -> float | None:
    """Mean bend over the log of the tendon whose friction was named by its bends [rad].

    The coefficient times the bend is the ratio of friction to tension. None unless the first named
    cause is of this kind.
    """
    if not found.causes or found.causes[0].candidate.location.note != CAPSTAN:
        return None
    model = load(truth.machine, assets).spec().compile()
    data = mujoco.MjData(model)
    tendons = [model.tendon(name).id for name in found.causes[0].candidate.location.elements]
    bends = []
    for posture in _postures(truth):
        _pose(model, data, posture)
        bends.append([total_bend(data, tendon) for tendon in tendons])
    return float(np.mean(bends))


def _postures(truth: Truth) -> Floats:
    """Some postures of the log, shape (k, joints) [rad]."""
    postures = np.concatenate([episode.qpos for episode in truth.episodes])
    return postures[:: max(1, len(postures) // POSTURES)]


def _pose(model: mujoco.MjModel, data: mujoco.MjData, posture: Floats) -> None:
    data.qpos[:] = posture
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_tendon(model, data)


def _lengths(machine: Machine, postures: Floats, shifts: dict[str, Floats]) -> Floats:
    """Lengths with moved sites, relative to those at ``qpos0``, shape (k, tendons) [m]."""
    spec = machine.spec()
    for name, shift in shifts.items():
        spec.site(name).pos = spec.site(name).pos + shift
    model = spec.compile()
    data = mujoco.MjData(model)
    lengths = np.empty((len(postures) + 1, model.ntendon))
    for row, posture in zip(lengths, [model.qpos0, *postures], strict=True):
        _pose(model, data, posture)
        row[:] = data.ten_length
    return lengths[1:] - lengths[0]
