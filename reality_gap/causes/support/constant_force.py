"""Constant force along a tendon or on a joint, for which MuJoCo has no element."""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Hook


def constant_force(model: mujoco.MjModel, kind: str, name: str, force: float) -> Hook:
    """Make a hook that applies a constant force.

    Args:
        model: the compiled model.
        kind: "tendon" or "joint".
        name: name of the element.
        force: positive forces lengthen the tendon, or push the joint in its positive direction
            [N or N m].
    """
    if kind == "joint":
        dof = int(model.joint(name).dofadr[0])

        def push_joint(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            data.qfrc_applied[dof] += force

        return push_joint
    tendon = model.tendon(name).id
    start = int(model.ten_J_rowadr[tendon])
    row = slice(start, start + int(model.ten_J_rownnz[tendon]))
    dofs = model.ten_J_colind[row]

    def push_tendon(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        data.qfrc_applied[dofs] += force * data.ten_J[row]

    return push_tendon
