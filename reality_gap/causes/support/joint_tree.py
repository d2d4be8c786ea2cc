"""Joint tree: the joint before a joint, fixed tendons over both, and joints that nothing drives."""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.support import actuators, lever_arms
from reality_gap.causes.support.new_elements import add_tendon
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
        if 0 <= int(model.body_jntadr[body]) <= last:
            name = model.joint(last).name
            same = model.jnt_type[last] == model.jnt_type[here]
            return name if same and name in system.joints else ""
        body = int(model.body_parentid[body])
        last = int(model.body_jntadr[body] + model.body_jntnum[body]) - 1
    return ""


def add_fixed_tendon(
    spec: mujoco.MjSpec, cause: str, joint: str, before: str, ratio: float
) -> mujoco.MjsTendon:
    """Add a fixed tendon over a joint and the joint before it.

    Args:
        spec: edited in place.
        cause: id of the cause; the name of the tendon begins with it.
        joint: name of the joint, whose coefficient is 1.
        before: name of the joint before it.
        ratio: coefficient of the joint before.

    Returns:
        The new tendon.
    """
    name = f"{cause}/{joint}/{before}"
    while spec.tendon(name) is not None:
        name += "'"
    tendon = add_tendon(spec, name=name)
    tendon.wrap_joint(joint, 1.0)
    tendon.wrap_joint(before, ratio)
    return tendon


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
