"""Closed loops: the state of joints that no reading shows, in a mechanism with constraints.

An episode begins where the readings of its joints do. In a five-bar linkage, a gripper with coupled
fingers or a parallel robot, the joints that have no encoder follow from those by the constraints of
the model. Without that the loop would be open at first, and close with a blow.
"""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from reality_gap.types import Bools, Floats

STEPS = 10
"""Steps from the model's posture to that of the readings, so that a linkage does not turn over."""
TRIES = 20
"""Largest number of corrections in each step."""
CLOSED = 1e-9
"""Violation of constraints up to which loops are closed [m or rad]."""
SINGULAR = 1e-6
"""Singular value over the largest one up to which constraints do not hold a motion [1]."""
FARTHEST = 0.3
"""Largest correction of a joint at once [m or rad]."""


def set_state(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    joints: Mapping[str, float],
    speeds: Mapping[str, float],
) -> None:
    """Set the state of some joints, and that of the others in the same loops.

    Args:
        model: the model.
        data: at ``qpos0``; its state is changed.
        joints: positions by joint [m or rad].
        speeds: velocities by joint [m/s or rad/s].
    """
    addresses = [model.joint(name).qposadr[0] for name in joints]
    wanted = np.array(list(joints.values()), dtype=np.float64)
    free = np.ones(model.nv, dtype=bool)
    free[[model.joint(name).dofadr[0] for name in joints]] = False
    looped = bool(joints and free.any() and data.eq_active.any())
    begin = data.qpos[addresses].copy()
    for share in np.linspace(0.0, 1.0, STEPS + 1)[1:] if looped else ():
        data.qpos[addresses] = begin + share * (wanted - begin)
        _close(model, data, free)
    data.qpos[addresses] = wanted
    for name, speed in speeds.items():
        data.qvel[model.joint(name).dofadr[0]] = speed
    if looped:
        rows, _ = _constraints(model, data)
        data.qvel[free] -= _least_squares(rows[:, free], rows @ data.qvel)


def _close(model: mujoco.MjModel, data: mujoco.MjData, free: Bools) -> None:
    """Move the free degrees of freedom until the equality constraints hold."""
    for _ in range(TRIES):
        rows, violation = _constraints(model, data)
        if np.abs(violation).max(initial=0.0) <= CLOSED:
            return
        change = np.zeros(model.nv)
        change[free] = -_least_squares(rows[:, free], violation)
        change *= min(1.0, FARTHEST / max(float(np.abs(change).max()), FARTHEST))
        mujoco.mj_integratePos(model, data.qpos, change, 1.0)


def _constraints(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Floats, Floats]:
    """Return the Jacobian (k, nv) of the equality constraints and their violation (k,)."""
    mujoco.mj_fwdPosition(model, data)
    of_equality = data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    rows = np.zeros((data.nefc, model.nv))
    if mujoco.mj_isSparse(model):
        mujoco.mju_sparse2dense(
            rows, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind
        )
    else:
        rows[:] = data.efc_J.reshape(rows.shape)
    return rows[of_equality], data.efc_pos[of_equality]


def _least_squares(rows: Floats, values: Floats) -> Floats:
    """Return the smallest solution of rows x = values, as far as there is one."""
    return np.asarray(np.linalg.lstsq(rows, values, rcond=SINGULAR)[0])
