"""Light model: a model without what is only seen, for replays.

Meshes and textures make each compilation and each record of a simulation large, and most of them
change no force and no reading.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.types import Bools

SEEING = (
    mujoco.mjtSensor.mjSENS_RANGEFINDER,
    mujoco.mjtSensor.mjSENS_GEOMDIST,
    mujoco.mjtSensor.mjSENS_GEOMNORMAL,
    mujoco.mjtSensor.mjSENS_GEOMFROMTO,
)
"""Types of sensors whose readings depend on geoms that cannot collide."""


def light_spec(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """Return a copy of a model without visual elements, if it has meshes or textures.

    Geoms that can collide with no other geom are visual, too. Masses and inertias stay. A model
    with sensors that see visual geoms stays as it is.

    Args:
        spec: the model; it is not changed.
    """
    light: mujoco.MjSpec = spec.copy()
    sees = any(sensor.type in SEEING for sensor in light.sensors)
    if sees or not (light.meshes or light.textures or light.skins):
        return light
    for geom, collides in zip(light.geoms, can_collide(light.copy().compile()), strict=True):
        if not collides:
            geom.contype = geom.conaffinity = 0
    light.discard_visual()
    return light


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
