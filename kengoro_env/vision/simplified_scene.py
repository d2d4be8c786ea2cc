"""Simplified scenes: planes and tendons are rendered with fewer faces.

A plane is rendered as a thin box, which is cheaper in Mesa: seen from above, under directional
lights, it has the same pixels. A tendon, a few pixels wide, is rendered as a box along it. The part
of a tendon between its spool and its guide is not rendered. `simplify` of scene.c does the same.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.robot.tendons import spool_joint
from kengoro_env.vision.renderer import Renderer

_TENDON, _JOINT = int(mujoco.mjtObj.mjOBJ_TENDON), int(mujoco.mjtObj.mjOBJ_JOINT)
_PLANE, _BOX, _NONE = (
    int(kind)
    for kind in (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_NONE)
)
_THIN = 1e-4
"""Half the thickness of the box of a plane [m]."""


def spooled(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Which tendons of a model have a spool (ntendon,)."""
    joints = [spool_joint(model.tendon(i).name) for i in range(model.ntendon)]
    return np.array([mujoco.mj_name2id(model, _JOINT, name) >= 0 for name in joints], dtype=bool)


class SimpleRenderer(Renderer):
    """A `mujoco.Renderer` of simplified scenes."""

    def __init__(self, model: mujoco.MjModel, *args: Any) -> None:
        super().__init__(model, *args)
        self._spooled = spooled(model)

    def update_scene(self, data: mujoco.MjData, *args: Any) -> None:
        """Update the scene as `mujoco.Renderer` does, then simplify it."""
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
    """Whether a camera is on the side of a plane that its normal points to."""
    return bool((camera.pos - plane.pos) @ plane.mat[:, 2] > 0.0)
