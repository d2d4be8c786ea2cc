"""Links: bodies that are welded together, whose masses only show in their sum."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from reality_gap.causes.support import lever_arms
from reality_gap.study.system import System, commanded

LIGHT = 0.01
"""Share of the moving mass below which a link is too light for an error of its mass to show."""

_GEOM = mujoco.mjtInertiaFromGeom


@dataclass(frozen=True)
class Link:
    """Bodies that move as one.

    Attributes:
        name: name of its first body, which has the joints.
        bodies: names of its bodies with mass.
        heaviest: name of the heaviest of them.
        mass: sum of their masses [kg].
    """

    name: str
    bodies: tuple[str, ...]
    heaviest: str
    mass: float


def links(system: System) -> tuple[Link, ...]:
    """Return the moving links that are not too light and whose bodies have names."""
    model = system.model
    moving = [b for b in range(1, model.nbody) if model.body_weldid[b] != 0]
    total = float(sum(model.body_mass[b] for b in moving))
    roots = dict.fromkeys(int(model.body_weldid[b]) for b in moving)
    found = [link(system, root) for root in roots]
    return tuple(x for x in found if x.mass > LIGHT * total and x.name and all(x.bodies))


def link(system: System, root: int) -> Link:
    """Return the link whose first body has this id."""
    model = system.model
    members = np.flatnonzero((model.body_weldid == root) & (model.body_mass > 0))
    masses = model.body_mass[members]
    names = tuple(model.body(int(b)).name for b in members)
    heaviest = names[int(np.argmax(masses))] if names else ""
    return Link(model.body(root).name, names, heaviest, float(masses.sum()))


def end_links(system: System) -> tuple[int, ...]:
    """Return the first bodies of the last links of each limb that are driven or measured.

    A hand is such a link, for example, but passive fingers beyond it are not.
    """
    model = system.model
    weld, parent = model.body_weldid, model.body_parentid
    roots = {int(w) for w in weld if w != 0}
    inner = {int(weld[parent[root]]) for root in roots}
    driven = _driven(system)
    found = []
    for end in sorted(roots - inner):
        while end not in driven and int(weld[parent[end]]) != 0:
            end = int(weld[parent[end]])
        found.append(end)
    return tuple(dict.fromkeys(found))


def editable_body(spec: mujoco.MjSpec, system: System, name: str) -> mujoco.MjsBody:
    """Return a body of a spec whose ``mass``, ``ipos`` and ``inertia`` can be edited.

    If the model derives them from geoms or gives a full inertia matrix, the compiled values are
    written into the spec.
    """
    if spec.compiler.inertiafromgeom == _GEOM.mjINERTIAFROMGEOM_TRUE:
        for index in range(1, system.model.nbody):
            _set_compiled_inertia(spec.body(system.model.body(index).name), system.model, index)
        spec.compiler.inertiafromgeom = _GEOM.mjINERTIAFROMGEOM_AUTO
    body = spec.body(name)
    plain = body.ialt.type == mujoco.mjtOrientation.mjORIENTATION_QUAT
    if not (body.explicitinertial and plain and np.isnan(body.fullinertia[0])):
        _set_compiled_inertia(body, system.model, system.model.body(name).id)
    return body


def _driven(system: System) -> set[int]:
    """Return the first bodies of links that are actuated, measured, or held in a closed loop."""
    model = system.model
    joints = {model.joint(name).id for name in lever_arms.actuated_joints(system)}
    joints |= {
        int(model.actuator_trnid[i, 0])
        for i in commanded(model)
        if int(model.actuator_trntype[i]) == int(mujoco.mjtTrn.mjTRN_JOINT)
    }
    for channel in system.study.channels:
        if channel.kind == "effort":
            joints.add(model.joint(channel.sensor).id)
        elif int(model.sensor(channel.sensor).type[0]) == int(mujoco.mjtSensor.mjSENS_JOINTPOS):
            joints.add(int(model.sensor(channel.sensor).objid[0]))
    driven = {int(model.body_weldid[model.jnt_bodyid[j]]) for j in joints}
    return driven | {int(model.body_weldid[body]) for body in _held_bodies(model)}


def _held_bodies(model: mujoco.MjModel) -> set[int]:
    """Return the bodies that equality constraints connect or weld to another moving one."""
    kinds = (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD))
    of_sites, found = int(mujoco.mjtObj.mjOBJ_SITE), set[int]()
    for i in range(model.neq):
        both = (int(model.eq_obj1id[i]), int(model.eq_obj2id[i]))
        if int(model.eq_type[i]) not in kinds or not model.eq_active0[i]:
            continue
        if int(model.eq_objtype[i]) == of_sites:
            both = (int(model.site_bodyid[both[0]]), int(model.site_bodyid[both[1]]))
        if all(model.body_weldid[body] for body in both):
            found.update(both)
    return found


def _set_compiled_inertia(body: mujoco.MjsBody | None, model: mujoco.MjModel, index: int) -> None:
    if body is None or model.body_mass[index] == 0:
        return
    body.explicitinertial = True
    body.mass = model.body_mass[index]
    body.ipos, body.iquat = model.body_ipos[index], model.body_iquat[index]
    body.inertia = model.body_inertia[index]
    body.fullinertia = np.array([np.nan, 0.0, 0.0, 0.0, 0.0, 0.0])
    body.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
