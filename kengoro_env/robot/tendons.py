"""Tendons and their actuators: writes a draft into its MuJoCo model.

An ideal tendon is that of the nominal model, with an actuator on it. A tendon that stretches runs
from its first site, the guide, to a motor on a spool: a slide joint that carries the end of the
tendon, so that the encoder reads the length paid out, path minus stretch, as on the robot.
`muscle_law` has the law of the actuators.
"""

from __future__ import annotations

import mujoco
import numpy as np

from kengoro_env.errors import ModelError
from kengoro_env.robot.draft import Draft, TendonSpec
from kengoro_env.robot.muscle_law import DEFAULT_GAINS, add_affine_actuator

SPOOL_TRAVEL = 0.6
"""Travel of a spool [m]; the end of the tendon starts in its middle, away from the guide."""

SPOOL_MASS = 0.001
"""Mass of a spool [kg], small against any link."""


def spool_joint(muscle: str) -> str:
    """Name of the slide joint of a muscle's spool."""
    return f"spool_{muscle}"


def actuated_joints(model: mujoco.MjModel) -> tuple[str, ...]:
    """Names of the hinges and slides that tendons through sites cross, in the model's order.

    A tendon crosses a joint if some of its points move with it and others do not. Joints of spools
    are left out.
    """
    moved = np.eye(model.nbody, dtype=bool)  # [a, b]: body b is a or a descendant of a
    for body in range(1, model.nbody):
        moved[:, body] |= moved[:, model.body_parentid[body]]
    at_site = model.wrap_type == int(mujoco.mjtWrap.mjWRAP_SITE)
    crossed = np.zeros(model.nbody, dtype=bool)
    for start, count in zip(model.tendon_adr, model.tendon_num, strict=True):
        part = slice(start, start + count)
        bodies = model.site_bodyid[model.wrap_objid[part][at_site[part]]]
        crossed |= moved[:, bodies].any(axis=1) & ~moved[:, bodies].all(axis=1)
    scalar = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    found = [
        model.joint(j).name
        for j in range(model.njnt)
        if model.jnt_type[j] in scalar and crossed[model.jnt_bodyid[j]]
    ]
    spools = {spool_joint(model.tendon(i).name) for i in range(model.ntendon)}
    return tuple(name for name in found if name not in spools)


def wind(draft: Draft, damping: float = DEFAULT_GAINS.damping) -> None:
    """Write the tendons of a draft and their actuators into its model; `Motors` sets the gains.

    Args:
        draft: the robot; tendons that are no muscles stay as they are.
        damping: viscous friction of a motor, seen at the tendon [N s/m].

    Raises:
        ModelError: MuJoCo cannot simulate a tendon as planned.
    """
    for tendon in [tendon for tendon in draft.spec.tendons if tendon.name in draft.tendons]:
        muscle, planned = tendon.name, draft.tendons[tendon.name]
        if planned.wraps and planned.motor_inertia and not planned.stiffness:
            raise ModelError(
                f"the tendon of {muscle} wraps over a bone, and its motor has inertia: MuJoCo can "
                "simulate both only for a tendon that stretches; add TendonStretch"
            )
        if planned.wraps or planned.stiffness:
            tendon = _replace_tendon(draft.spec, tendon, planned, damping)
        if planned.stiffness:
            joint = draft.spec.joint(spool_joint(muscle))
            joint.armature = planned.motor_inertia
            joint.frictionloss = planned.friction
            add_affine_actuator(draft.spec, muscle, mujoco.mjtTrn.mjTRN_JOINT, joint.name)
        else:
            tendon.armature = planned.motor_inertia
            tendon.frictionloss = planned.friction
            tendon.damping = np.array([damping, 0.0, 0.0])
            add_affine_actuator(draft.spec, muscle, mujoco.mjtTrn.mjTRN_TENDON, muscle)


def _replace_tendon(
    spec: mujoco.MjSpec, old: mujoco.MjsTendon, planned: TendonSpec, damping: float
) -> mujoco.MjsTendon:
    """Replace a tendon by one that wraps over its bones and starts at its spool, if it has one."""
    name, sites = old.name, [element.target.name for element in old.path]
    kind = old.default()
    spec.delete(old)
    tendon = spec.add_tendon(kind, name=name)
    if planned.stiffness:
        tendon.wrap_site(_add_spool(spec, name, sites[0], damping))
        tendon.stiffness = np.array(planned.stiffness)
        tendon.springlength = np.array([0.0, SPOOL_TRAVEL])  # `Motors` sets the true length
    for index, site in enumerate(sites):
        tendon.wrap_site(site)
        if index in planned.wraps:
            tendon.wrap_geom(*planned.wraps[index])
    return tendon


def _add_spool(spec: mujoco.MjSpec, muscle: str, guide: str, damping: float) -> str:
    """Add a slide joint behind the guide that carries the end of the tendon; return its site."""
    site = spec.site(guide)
    body = site.parent.add_body(name=spool_joint(muscle), pos=site.pos, gravcomp=1.0)
    body.mass, body.inertia = SPOOL_MASS, np.full(3, 1e-7)
    body.explicitinertial = True
    body.add_joint(
        name=spool_joint(muscle),
        type=mujoco.mjtJoint.mjJNT_SLIDE,
        axis=np.array([0.0, 0.0, 1.0]),
        damping=np.array([damping, 0.0, 0.0]),
    )
    end = body.add_site(name=f"{muscle}_spool")
    return end.name
