"""Surfaces: points on the geoms of a link."""

from __future__ import annotations

from itertools import product

import mujoco
import numpy as np

from reality_gap.types import Floats

NEAR = 0.02
"""Share of the largest distance by which other points count as far, too."""

_GEOM = mujoco.mjtGeom
_CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


def far_point(
    model: mujoco.MjModel, data: mujoco.MjData, root: int, begin: Floats
) -> Floats | None:
    """Return the point of a link that is farthest from a point, shape (3,) [m].

    It is the middle of all points that are hardly nearer, such as the corners of a box.

    Args:
        model: the model.
        data: its state, with the poses of the geoms.
        root: id of the first body of the link.
        begin: a point in the world, shape (3,) [m].

    Returns:
        The point in the world; None for a link without geoms.
    """
    geoms = np.flatnonzero(model.body_weldid[model.geom_bodyid] == root)
    points = [
        data.geom_xpos[g] + local_points(model, int(g)) @ data.geom_xmat[g].reshape(3, 3).T
        for g in geoms
    ]
    if not points:
        return None
    every = np.concatenate(points)
    distance = np.linalg.norm(every - begin, axis=1)
    found: Floats = every[distance >= (1.0 - NEAR) * distance.max()].mean(axis=0)
    return found


def local_points(model: mujoco.MjModel, geom: int) -> Floats:
    """Return points on the surface of a geom in its frame, shape (k, 3) [m]."""
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == int(_GEOM.mjGEOM_MESH):
        mesh = int(model.geom_dataid[geom])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        return np.asarray(model.mesh_vert[first : first + count], dtype=np.float64)
    ends = np.vstack([np.eye(3), -np.eye(3)])
    if kind == int(_GEOM.mjGEOM_SPHERE):
        return ends * size[0]
    if kind == int(_GEOM.mjGEOM_CAPSULE):
        return np.array([[0.0, 0.0, size[0] + size[1]], [0.0, 0.0, -size[0] - size[1]]])
    if kind == int(_GEOM.mjGEOM_CYLINDER):
        return np.array([[0.0, 0.0, size[1]], [0.0, 0.0, -size[1]]])
    return _CORNERS * size if kind == int(_GEOM.mjGEOM_BOX) else ends * size
