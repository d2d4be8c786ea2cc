"""Points of a hand that its detector locates: chosen from the model, far from each other."""

from __future__ import annotations

import mujoco
import numpy as np

from kengoro_env.robot.subtree import subtree
from kengoro_env.types import Floats


def hand_points(model: mujoco.MjModel, body: int, count: int, geoms: set[int]) -> Floats:
    """Points of a hand in its own axes, at the model's own posture (count, 3) [m].

    Each is the farthest from those before it; the first is the farthest from the middle. They are
    vertices of meshes, corners of boxes, and of other geoms the middles of the sides of the box
    around them.

    Args:
        model: of the robot.
        body: number of the hand's body.
        count: number of points.
        geoms: numbers of the geoms that are drawn of it.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = []
    for number in sorted(geoms):
        corners = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3)
        middle, half = model.geom_aabb[number, :3], model.geom_aabb[number, 3:]
        if model.geom_type[number] != mujoco.mjtGeom.mjGEOM_BOX:
            corners = np.concatenate([np.eye(3), -np.eye(3)])
        own = middle + corners * half
        if model.geom_type[number] == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.mesh(model.geom_dataid[number])
            begin = int(mesh.vertadr[0])
            own = model.mesh_vert[begin : begin + int(mesh.vertnum[0])]
        frame = data.geom_xmat[number].reshape(3, 3)
        found.append(own @ frame.T + data.geom_xpos[number])
    points = np.concatenate(found)
    points = (points - data.xpos[body]) @ data.xmat[body].reshape(3, 3)
    chosen = [int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1)))]
    while len(chosen) < count:
        distances = np.linalg.norm(points[:, None] - points[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(distances)))
    return np.asarray(points[chosen])


def hand_geoms(model: mujoco.MjModel, body: int) -> set[int]:
    """Numbers of the geoms of finite size that are drawn of a body and its descendants."""
    visible = subtree(model, body)[model.geom_bodyid] & (model.geom_group < 3)
    endless = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)
    visible &= ~np.isin(model.geom_type, [int(kind) for kind in endless])
    return set(np.flatnonzero(visible).tolist())
