"""A constant force along a wire or on a joint, where MuJoCo has no place for one."""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Hook


def push(model: mujoco.MjModel, kind: str, name: str, force: float) -> Hook:
    """A hook that applies the force.

    Args:
        model: the compiled model.
        kind: "tendon" or "joint".
        name: of the element.
        force: towards a longer wire, or the joint's positive way [N or N m].
    """
    if kind == "joint":
        dof = int(model.joint(name).dofadr[0])

        def on_joint(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            data.qfrc_applied[dof] += force

        return on_joint
    tendon = model.tendon(name).id
    start = int(model.ten_J_rowadr[tendon])
    row = slice(start, start + int(model.ten_J_rownnz[tendon]))
    dofs = model.ten_J_colind[row]

    def along_tendon(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        data.qfrc_applied[dofs] += force * data.ten_J[row]

    return along_tendon
