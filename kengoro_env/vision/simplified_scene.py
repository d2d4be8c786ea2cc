"""Planes and wires drawn with fewer faces, and what is wound up of a wire not at all.

A plane is drawn as a thin box, which takes Mesa less: from above it looks the same under lights
that shine from afar. A wire, a few pixels wide, is drawn as a box along it. Wound up is the first
part of a wire with a spool, from there to its guide. `simplify` of scene.c does the same.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.robot.tendons import spool_joint

_TENDON, _JOINT = int(mujoco.mjtObj.mjOBJ_TENDON), int(mujoco.mjtObj.mjOBJ_JOINT)
_PLANE, _BOX, _NONE = (
    int(kind)
    for kind in (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_NONE)
)
_THIN = 1e-4
"""Half the thickness of a plane that is drawn as a box [m]."""


def spooled(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Which tendons of a model have a spool, (ntendon,)."""
    joints = [spool_joint(model.tendon(i).name) for i in range(model.ntendon)]
    return np.array([mujoco.mj_name2id(model, _JOINT, name) >= 0 for name in joints], dtype=bool)


class SimpleRenderer(mujoco.Renderer):
    """A `mujoco.Renderer` of simplified scenes."""

    def __init__(self, model: mujoco.MjModel, *args: Any) -> None:
        super().__init__(model, *args)
        self._spooled = spooled(model)

    def update_scene(self, data: mujoco.MjData, *args: Any) -> None:
        """As of `mujoco.Renderer`, simplified."""
        super().update_scene(data, *args)
        last, camera = -1, self.scene.camera[0]
        for geom in self.scene.geoms[: self.scene.ngeom]:
            if geom.objtype == _TENDON:
                if geom.objid != last and self._spooled[geom.objid]:
                    geom.type = _NONE
                elif geom.type != _NONE:
                    geom.type = _BOX
                last = geom.objid
            elif geom.type == _PLANE and min(geom.size[:2]) > 0.0 and _from_above(geom, camera):
                geom.type, geom.size[2] = _BOX, _THIN


def _from_above(plane: mujoco.MjvGeom, camera: mujoco.MjvGLCamera) -> bool:
    """Whether a camera looks at the side of a plane that hides what is behind."""
    return bool((camera.pos - plane.pos) @ plane.mat[:, 2] > 0.0)
