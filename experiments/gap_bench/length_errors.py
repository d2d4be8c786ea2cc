"""What a named number does to the wires over a log, where it cannot be compared as it stands.

Of a moved site the lengths count; of friction around bends what it is of the tension.
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
"""At most as many of the log's postures are compared at."""


def length_error(truth: Truth, found: Diagnosis, assets: Path) -> float | None:
    """RMS over the log's postures of the wire whose length is told worst [m].

    Lengths are relative to the drawing's at ``qpos0``, where encoders were zeroed. None unless a
    site was moved and a moved site was named.
    """
    true = {
        site: np.array([e.parameters[axis] for axis in "xyz"])
        for e in truth.secret.effects
        if e.id == ID
        for site in e.elements
    }
    told: dict[str, Floats] = {}
    for cause in found.causes:
        if cause.candidate.cause.id == ID:
            value = {name: e.value for name, e in cause.parameters.items()}
            for site in cause.candidate.location.elements:
                single = "x" in value
                names = [axis if single else f"{site}.{axis}" for axis in "xyz"]
                told[site] = np.array([value[name] for name in names])
    if not true or not told:
        return None
    machine, postures = load(truth.machine, assets), _postures(truth)
    gap = _lengths(machine, postures, true) - _lengths(machine, postures, told)
    return float(np.sqrt(np.mean(gap**2, axis=0)).max())


def bend(truth: Truth, found: Diagnosis, assets: Path) -> float | None:
    """Mean bend of the wire over the log, whose friction was told by its bends [rad].

    Such a coefficient times the bend is what friction is of the tension. None unless the first
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
    """Some of the log's (k, joints) [rad]."""
    postures = np.concatenate([episode.qpos for episode in truth.episodes])
    return postures[:: max(1, len(postures) // POSTURES)]


def _pose(model: mujoco.MjModel, data: mujoco.MjData, posture: Floats) -> None:
    data.qpos[:] = posture
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_tendon(model, data)


def _lengths(machine: Machine, postures: Floats, shifts: dict[str, Floats]) -> Floats:
    """Lengths of wires (k, wires) [m] with sites moved, relative to those at ``qpos0``."""
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
