"""How well a moved site was found: what counts is the wires' lengths, not the numbers."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from hidden_plants import Truth
from hidden_plants.machine import Machine, load
from reality_gap import Diagnosis

Array = NDArray[np.float64]
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
    told: dict[str, Array] = {}
    for cause in found.causes:
        if cause.suspect.cause.id == ID:
            value = {name: e.value for name, e in cause.parameters.items()}
            for site in cause.suspect.place.elements:
                single = "x" in value
                names = [axis if single else f"{site}.{axis}" for axis in "xyz"]
                told[site] = np.array([value[name] for name in names])
    if not true or not told:
        return None
    machine = load(truth.machine, assets)
    postures = np.concatenate([episode.qpos for episode in truth.episodes])
    postures = postures[:: max(1, len(postures) // POSTURES)]
    gap = _lengths(machine, postures, true) - _lengths(machine, postures, told)
    return float(np.sqrt(np.mean(gap**2, axis=0)).max())


def _lengths(machine: Machine, postures: Array, shifts: dict[str, Array]) -> Array:
    """Lengths of wires (k, wires) [m] with sites moved, relative to those at ``qpos0``."""
    spec = machine.spec()
    for name, shift in shifts.items():
        spec.site(name).pos = spec.site(name).pos + shift
    model = spec.compile()
    data = mujoco.MjData(model)
    lengths = np.empty((len(postures) + 1, model.ntendon))
    for row, posture in zip(lengths, [model.qpos0, *postures], strict=True):
        data.qpos[:] = posture
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        row[:] = data.ten_length
    return lengths[1:] - lengths[0]
