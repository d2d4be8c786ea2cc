"""Wires and their motors: from a draft to tendons, spools and stiffness-controlled actuators.

An ideal wire is the drawing's tendon with an actuator on it. A wire that stretches leaves its
first site (the guide) for a motor on a spool: a slide joint that carries the wire's end, so that
the encoder reads what the spool paid out, path minus stretch, as on the robot.

Muscle stiffness control (paper, sec. III-B), T = T_bias + max(0, K (l - l_target)), is a stock
affine actuator cut at T_bias and T_max; it runs at the physics rate.
"""

from __future__ import annotations

import mujoco
import numpy as np

from kengoro_env.errors import KengoroError
from kengoro_env.robot.draft import Draft, TendonSpec

SPOOL_TRAVEL = 0.6
"""Length of a spool's travel [m]; the wire's end starts in its middle, away from the guide."""

SPOOL_MASS = 0.001
MOTOR_DAMPING = 150.0
"""Viscous friction of a motor, seen at the wire [N s/m]; it acts only while the motor turns."""


def spool_joint(muscle: str) -> str:
    """Name of the slide joint of a muscle's spool."""
    return f"spool_{muscle}"


def actuated_joints(model: mujoco.MjModel) -> tuple[str, ...]:
    """Hinges and slides that a wire through sites crosses, in the model's order, without spools.

    A wire crosses a joint if some of its points move with it and others do not.
    """
    moved = np.eye(model.nbody, dtype=bool)  # [a, b]: body b hangs on body a, or is it
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


def wind(draft: Draft) -> None:
    """Write the draft's wires and their motors into its spec; `Motors` sets the gains."""
    for tendon in list(draft.spec.tendons):
        muscle, planned = tendon.name, draft.tendons[tendon.name]
        if planned.wraps and planned.motor_inertia and not planned.stiffness:
            raise KengoroError(
                f"the wire of {muscle} wraps over a bone, and its motor has inertia: MuJoCo can do "
                "both only for a wire that stretches; add TendonStretch"
            )
        if planned.wraps or planned.stiffness:
            tendon = _lay(draft.spec, tendon, planned)
        if planned.stiffness:
            joint = draft.spec.joint(spool_joint(muscle))
            joint.armature = planned.motor_inertia
            joint.frictionloss = planned.friction
            _add_motor(draft.spec, muscle, mujoco.mjtTrn.mjTRN_JOINT, joint.name)
        else:
            tendon.armature = planned.motor_inertia
            tendon.frictionloss = planned.friction
            tendon.damping = np.array([MOTOR_DAMPING, 0.0, 0.0])
            _add_motor(draft.spec, muscle, mujoco.mjtTrn.mjTRN_TENDON, muscle)


def _lay(spec: mujoco.MjSpec, old: mujoco.MjsTendon, planned: TendonSpec) -> mujoco.MjsTendon:
    """Lay a wire anew, over its bones and from its spool if it has one."""
    name, sites = old.name, [element.target.name for element in old.path]
    kind = old.default()
    spec.delete(old)
    tendon = spec.add_tendon(kind, name=name)
    if planned.stiffness:
        tendon.wrap_site(_add_spool(spec, name, sites[0]))
        tendon.stiffness = np.array(planned.stiffness)
        tendon.springlength = np.array([0.0, SPOOL_TRAVEL])  # set to the true length by `Motors`
    for index, site in enumerate(sites):
        tendon.wrap_site(site)
        if index in planned.wraps:
            tendon.wrap_geom(*planned.wraps[index])
    return tendon


def _add_spool(spec: mujoco.MjSpec, muscle: str, guide: str) -> str:
    """A slide joint behind the guide site that carries the wire's end; returns the end's site."""
    site = spec.site(guide)
    body = site.parent.add_body(name=spool_joint(muscle), pos=site.pos, gravcomp=1.0)
    body.mass, body.inertia = SPOOL_MASS, np.full(3, 1e-7)
    body.explicitinertial = True
    body.add_joint(
        name=spool_joint(muscle),
        type=mujoco.mjtJoint.mjJNT_SLIDE,
        axis=np.array([0.0, 0.0, 1.0]),
        damping=np.array([MOTOR_DAMPING, 0.0, 0.0]),
    )
    end = body.add_site(name=f"{muscle}_spool")
    return end.name


def _add_motor(spec: mujoco.MjSpec, muscle: str, transmission: mujoco.mjtTrn, target: str) -> None:
    actuator = spec.add_actuator(name=muscle, target=target, trntype=transmission)
    actuator.gaintype = mujoco.mjtGain.mjGAIN_FIXED
    actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    actuator.forcelimited = True
    actuator.forcerange = np.array([-1.0, 1.0])
