"""Light model: a model without what is only seen, and without meshes that touch nothing.

Meshes and textures make each compilation and each record of a simulation large, and most of them
change no force and no reading. Meshes that may collide take half of the time of a replay.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.types import Bools, Floats

SEEING = (
    mujoco.mjtSensor.mjSENS_RANGEFINDER,
    mujoco.mjtSensor.mjSENS_GEOMDIST,
    mujoco.mjtSensor.mjSENS_GEOMNORMAL,
    mujoco.mjtSensor.mjSENS_GEOMFROMTO,
)
"""Types of sensors whose readings depend on geoms that cannot collide."""
FAR = 0.1
"""Distance from all other geoms at which a mesh touches nothing, over the size of the model."""
FURTHER = 1.0
"""Further change of a distance, over that of a motion, after which geoms must not touch."""
POSES = 200
"""Largest number of poses of a motion at which distances are examined."""


def light_spec(spec: mujoco.MjSpec, contacts: bool = True) -> mujoco.MjSpec:
    """Return a copy of a model without visual elements, if it has meshes or textures.

    Geoms that can collide with no other geom are visual, too. Masses and inertias stay. A model
    with sensors that see visual geoms stays as it is.

    Args:
        spec: the model; it is not changed.
        contacts: whether geoms may collide; if not, all of them are visual.
    """
    light: mujoco.MjSpec = spec.copy()
    sees = any(sensor.type in SEEING for sensor in light.sensors)
    if sees or not (light.meshes or light.textures or light.skins):
        return light
    able = can_collide(light.copy().compile()) if contacts else [False] * len(light.geoms)
    for geom, collides in zip(light.geoms, able, strict=True):
        if not collides:
            geom.contype = geom.conaffinity = 0
    light.discard_visual()
    return light


def without_distant_meshes(spec: mujoco.MjSpec, qpos: Floats) -> mujoco.MjSpec:
    """Return a copy of a model without the meshes that touch nothing during a motion.

    Masses and inertias stay. A model with sensors that see geoms stays as it is.

    Args:
        spec: the model; it is not changed.
        qpos: positions of the joints during the motion, shape (k, nq).
    """
    light: mujoco.MjSpec = spec.copy()
    if not light.meshes or any(sensor.type in SEEING for sensor in light.sensors):
        return light
    far = ~_come_near(light.copy().compile(), qpos[:: len(qpos) // POSES + 1])
    for geom, distant in zip(light.geoms, far, strict=True):
        if distant and geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            geom.contype = geom.conaffinity = 0
    light.discard_visual()
    return light


def _come_near(model: mujoco.MjModel, qpos: Floats) -> Bools:
    """Return whether each geom could touch another one in a similar motion, shape (ngeom,).

    Two geoms touch if their distance is 0, and could touch if it changes by so much during this
    motion that it would be 0 after `FURTHER` times the change.
    """
    data = mujoco.MjData(model)
    far = FAR * model.stat.extent
    model.geom_margin[:] = np.maximum(model.geom_margin, far)
    least = np.full((model.ngeom, model.ngeom), far)
    most = np.full_like(least, -np.inf)
    for now in qpos:
        data.qpos[:] = now
        mujoco.mj_fwdPosition(model, data)
        contacts = data.contact
        rigid = (contacts.geom >= 0).all(axis=1)
        distances = np.full_like(least, far)
        np.minimum.at(distances, tuple(contacts.geom[rigid].T), contacts.dist[rigid])
        least, most = np.minimum(least, distances), np.maximum(most, distances)
    touching = (least <= FURTHER * (most - least)) & (least < far)
    found: Bools = touching.any(axis=0) | touching.any(axis=1)
    found[np.concatenate([model.pair_geom1, model.pair_geom2]).astype(int)] = True
    return found


def can_collide(model: mujoco.MjModel) -> Bools:
    """Return whether each geom may collide with another one by MuJoCo's filters, shape (ngeom,).

    Args:
        model: the compiled model.
    """
    wanted = model.geom_contype[:, None] & model.geom_conaffinity[None, :]
    allowed = (wanted | wanted.T) != 0
    body = model.geom_bodyid
    weld = model.body_weldid[body]
    parent = model.body_weldid[model.body_parentid[weld]]
    allowed &= weld[:, None] != weld[None, :]
    if not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT):
        moving = (weld[:, None] != 0) & (weld[None, :] != 0)
        related = (parent[:, None] == weld[None, :]) | (parent[None, :] == weld[:, None])
        allowed &= ~(moving & related)
    for signature in model.exclude_signature:
        first, second = body == signature >> 16, body == signature & 0xFFFF
        allowed &= ~(np.outer(first, second) | np.outer(second, first))
    found: Bools = allowed.any(axis=1)
    found[np.concatenate([model.pair_geom1, model.pair_geom2]).astype(int)] = True
    if model.nflex:
        found |= (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    return found
