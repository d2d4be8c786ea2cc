"""Joint tree: which joint is before which one, and which joints nothing drives."""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.support import actuators, lever_arms
from reality_gap.study.system import System


def joint_before(system: System, joint: str) -> str:
    """Return the nearest hinge or slide before a joint, of the same kind; empty without one.

    Args:
        system: the machine.
        joint: name of a hinge or slide.
    """
    model, here = system.model, system.model.joint(joint).id
    body = int(model.jnt_bodyid[here])
    last = here - 1
    while body:
        first = int(model.body_jntadr[body])
        for j in range(last, first - 1, -1) if first >= 0 else ():
            name = model.joint(j).name
            if name not in system.joints or model.jnt_type[j] != model.jnt_type[here]:
                return ""
            return name
        body = int(model.body_parentid[body])
        last = int(model.body_jntadr[body] + model.body_jntnum[body]) - 1
    return ""


def passive_joints(system: System) -> tuple[str, ...]:
    """Return the joints that no actuator, actuated tendon or equality constraint moves."""
    model, moved = system.model, set[str]()
    for i in range(model.nactuator):
        if int(model.actuator_trntype[i]) in actuators.JOINT_TRANSMISSIONS:
            moved.add(model.joint(int(model.actuator_trnid[i, 0])).name)
        elif int(model.actuator_trntype[i]) != int(mujoco.mjtTrn.mjTRN_TENDON):
            return ()
    for e in np.flatnonzero(model.eq_type == int(mujoco.mjtEq.mjEQ_JOINT)):
        moved.add(model.joint(int(model.eq_obj1id[e])).name)
    crossed = {*moved, *lever_arms.actuated_joints(system)}
    return tuple(name for name in system.joints if name not in crossed)
