"""Machine size: typical forces, lengths and inertias of a machine, computed from its model alone.

All scales, tolerances and bounds of causes derive from these numbers, so that a finger of 0.1 N m
and an arm of 2500 N m are treated alike. Loads and lever arms are those at sampled postures without
velocity.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, replace
from functools import lru_cache

import mujoco
import numpy as np
from scipy.stats.qmc import Halton

from reality_gap.causes.support import actuators
from reality_gap.study.system import System, command_limits
from reality_gap.types import Bools, Floats

POSTURES = 64
"""Number of sampled postures."""
TENSION = 0.2
"""Typical tension of a tendon over the limit of its motor's force."""
MOTOR = 0.5
"""Typical force of a joint's motor over its limit."""
SWING = 3.0
"""Angular frequency of a typical motion, from which forces follow if nothing else tells [rad/s]."""
STRONG = 30.0
"""Largest typical force over what gravity and a typical motion need; limits above are no limits."""
TURN = 1.0
"""Half of the range of a hinge without limits [rad]."""
SHORT = 0.3
"""Half of the range of a slide without limits, over the size of the largest link."""
NEAR = 0.5
"""Smallest distance of a force from a joint's axis, over the size of the largest link."""
TINY = 1e-12
"""Smallest inverse inertia of a degree of freedom that moves [1/kg or 1/(kg m^2)]."""
GRAVITY = 9.81
"""Gravity on earth [m/s^2]."""

_HINGE, _SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)


@dataclass(frozen=True)
class MachineSize:
    """Typical sizes of a machine.

    Attributes:
        link: size of the largest link: distance from its joint to its farthest point [m].
        travel: half of the range of each degree of freedom, shape (nv,) [rad or m].
        inertia: inertia that moves with each degree of freedom, shape (nv,) [kg m^2 or kg].
        gravity: largest load by gravity of each degree of freedom, shape (nv,) [N m or N].
        arms: mean size of the lever arm of each tendon, shape (ntendon, nv) [m or 1].
        tendon_travel: largest change of length of each tendon, shape (ntendon,) [m].
        limit: largest force of each actuator, before its gear; 0 without, shape (nactuator,).
        load: typical force of each degree of freedom, shape (nv,) [N m or N].
        rated: largest force of the motors of each joint; 0 without a limit, shape (nv,) [N m or N].
        limited: whether a limit of a motor or of a tendon's motor is known, shape (nv,).
    """

    link: float
    travel: Floats
    inertia: Floats
    gravity: Floats
    arms: Floats
    tendon_travel: Floats
    limit: Floats
    load: Floats
    rated: Floats
    limited: Bools


def machine_size(system: System) -> MachineSize:
    """Return the typical sizes of a system's machine."""
    return _machine_size(system.model)


def dof(system: System, joint: str) -> int:
    """Return the degree of freedom of a hinge or slide joint."""
    return int(system.model.joint(joint).dofadr[0])


def end_force(system: System, body: str, load: Floats) -> float:
    """Return the force at a body's centre of mass that is typical for the weakest joint [N].

    Args:
        system: the machine.
        body: name of the body.
        load: typical force of each degree of freedom, shape (nv,) [N m or N].
    """
    model, size = system.model, machine_size(system)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    point, at, forces = data.xipos[model.body(body).id], model.body(body).id, list[float]()
    while at:
        first = int(model.body_jntadr[at])
        for j in range(first, first + int(model.body_jntnum[at])):
            own = float(load[model.jnt_dofadr[j]])
            if int(model.jnt_type[j]) == _HINGE:
                distance = float(np.linalg.norm(point - data.xanchor[j]))
                forces.append(own / max(distance, NEAR * size.link))
            elif int(model.jnt_type[j]) == _SLIDE:
                forces.append(own)
        at = int(model.body_parentid[at])
    return min(forces, default=weight(model, float(model.body_mass.sum())))


def weight(model: mujoco.MjModel, mass: float) -> float:
    """Return the weight of a mass [N], on Earth if the model has no gravity."""
    return mass * (float(np.linalg.norm(model.opt.gravity)) or GRAVITY)


@lru_cache(maxsize=4)
def _machine_size(model: mujoco.MjModel) -> MachineSize:
    link = _largest_link(model)
    travel = np.full(model.nv, TURN)
    for j in range(model.njnt):
        kind, at = int(model.jnt_type[j]), int(model.jnt_dofadr[j])
        if model.jnt_limited[j] and kind in (_HINGE, _SLIDE):
            travel[at] = 0.5 * float(np.ptp(model.jnt_range[j]))
        elif kind == _SLIDE:
            travel[at] = SHORT * link
    moves = model.dof_invweight0 > TINY
    inertia = np.where(moves, 1.0 / np.where(moves, model.dof_invweight0, 1.0), 0.0)
    gravity, arms, lengths = _at_postures(model, travel)
    limit = np.array([_limit(model, i) for i in range(model.nactuator)])
    found = MachineSize(
        link,
        travel,
        inertia,
        gravity,
        arms,
        np.ptp(lengths, axis=0),
        limit,
        load=np.zeros(model.nv),
        rated=np.zeros(model.nv),
        limited=np.zeros(model.nv, dtype=np.bool_),
    )
    needed = gravity + inertia * travel * SWING**2
    typical = _exerted(model, found, TENSION, MOTOR)
    load = np.where(typical > 0.0, np.minimum(typical, STRONG * needed), needed)
    load = np.where(load > 0.0, load, 1.0)
    rated = _exerted(model, found, 0.0, 1.0)
    return replace(found, load=load, rated=rated, limited=typical > 0.0)


def _largest_link(model: mujoco.MjModel) -> float:
    """Return the largest distance from a link's joint to a point of the link [m]."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    weld = model.body_weldid
    origin = np.array([data.xpos[weld[b]] for b in range(model.nbody)])
    reach = [0.0]
    for b in range(1, model.nbody):
        # The origin of a body belongs to its parent, too: it is where the next joint is. The world
        # is no link: where a machine stands is no size of it.
        if weld[model.body_parentid[b]]:
            reach.append(float(np.linalg.norm(data.xpos[b] - origin[model.body_parentid[b]])))
        # Without mass there is no centre of mass, and MuJoCo has any.
        if weld[b] and model.body_mass[b]:
            reach.append(float(np.linalg.norm(data.xipos[b] - origin[b])))
    for s in range(model.nsite):
        if weld[model.site_bodyid[s]]:
            reach.append(float(np.linalg.norm(data.site_xpos[s] - origin[model.site_bodyid[s]])))
    for g in range(model.ngeom):
        body = int(model.geom_bodyid[g])
        if weld[body]:
            far = float(np.linalg.norm(data.geom_xpos[g] - origin[body]))
            reach.append(far + float(model.geom_rbound[g]))
    return max(reach) or 1.0


def _at_postures(model: mujoco.MjModel, travel: Floats) -> tuple[Floats, Floats, Floats]:
    """Return gravity loads (nv,), lever arms (ntendon, nv) and lengths (POSTURES, ntendon)."""
    model = copy.copy(model)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data = mujoco.MjData(model)
    gravity, arms = np.zeros(model.nv), np.zeros((model.ntendon, model.nv))
    lengths = np.zeros((POSTURES, model.ntendon))
    for k, share in enumerate(Halton(max(1, model.njnt), scramble=False).random(POSTURES + 1)[1:]):
        data.qpos[:] = model.qpos0
        for j in range(model.njnt):
            if int(model.jnt_type[j]) in (_HINGE, _SLIDE):
                at = int(model.jnt_qposadr[j])
                limited = bool(model.jnt_limited[j])
                middle = model.jnt_range[j].mean() if limited else model.qpos0[at]
                data.qpos[at] = middle + (2 * share[j] - 1) * travel[model.jnt_dofadr[j]]
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        gravity = np.maximum(gravity, np.abs(data.qfrc_bias))
        lengths[k] = data.ten_length
        for t in range(model.ntendon):
            start = int(model.ten_J_rowadr[t])
            row = slice(start, start + int(model.ten_J_rownnz[t]))
            arms[t, model.ten_J_colind[row]] += np.abs(data.ten_J[row]) / POSTURES
    return gravity, arms, lengths


def _limit(model: mujoco.MjModel, actuator: int) -> float:
    """Return the largest force of an actuator, before its gear; 0 if nothing limits it."""
    muscle = int(mujoco.mjtGain.mjGAIN_MUSCLE)
    if model.actuator_forcelimited[actuator]:
        return float(np.max(np.abs(model.actuator_forcerange[actuator])))
    if int(model.actuator_gaintype[actuator]) == muscle:
        peak, scale = (float(x) for x in model.actuator_gainprm[actuator, 2:4])
        return peak if peak >= 0.0 else scale / max(float(model.actuator_acc0[actuator]), 1e-12)
    reach = max(map(abs, command_limits(model, actuator)))
    if actuators.has_constant_gain(model, actuator) and math.isfinite(reach):
        return reach * abs(float(model.actuator_gainprm[actuator, 0]))
    return 0.0


def _exerted(
    model: mujoco.MjModel, size: MachineSize, of_tendons: float, of_motors: float
) -> Floats:
    """Return the force that actuators with limits exert, shape (nv,) [N m or N].

    Args:
        model: the model.
        size: its limits and lever arms.
        of_tendons, of_motors: force of the actuators of tendons and joints over their limits.
    """
    load = np.zeros(model.nv)
    for i in np.flatnonzero(size.limit):
        kind, target = int(model.actuator_trntype[i]), int(model.actuator_trnid[i, 0])
        force = float(size.limit[i] * abs(model.actuator_gear[i, 0]))
        if kind == int(mujoco.mjtTrn.mjTRN_TENDON):
            load += of_tendons * force * size.arms[target]
        elif kind in actuators.JOINT_TRANSMISSIONS:
            load[model.jnt_dofadr[target]] += of_motors * force
    for j in np.flatnonzero(model.jnt_actfrclimited):
        at = int(model.jnt_dofadr[j])
        most = of_motors * float(np.max(np.abs(model.jnt_actfrcrange[j])))
        load[at] = min(load[at], most) if load[at] else most
    return load
