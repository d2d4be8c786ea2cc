"""Obstacles: joint axes and bones that a nominally straight tendon could wrap around.

Postures are sampled from the ranges of all joints. At each posture, a segment of a tendon's path is
projected into the plane in which it would wrap: across the axis of a cylinder, or through the
centre of a sphere. The distance of the projected segment from the axis or centre then is the radius
at which a body touches the tendon.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import mujoco
import numpy as np
from scipy.stats.qmc import Halton

from reality_gap.causes.support import typical_scales
from reality_gap.study.system import ActuatedTendon, System
from reality_gap.types import Bools, Floats

POSTURES = 64
"""Number of sampled postures."""
NEAR = 0.72
"""Largest distance of a straight tendon from the surface of a bone that is an obstacle, over the
typical lever arm of tendons."""
THICK = 1.15
"""Largest distance of a straight tendon from the axis of a joint that is an obstacle, likewise."""
OFTEN = 0.1
"""Smallest share of the postures in which a tendon must pass an obstacle."""
OTHER_SIDE = 0.05
"""Largest share of the postures in which a tendon may pass an obstacle on the other side."""
CLEAR = 0.95
"""Largest radius over the distance of the nearer end of the segment; ends must lie outside."""
MOST, LIFT = 0.8, 0.085
"""A typical radius lifts the tendon by `LIFT` lever arms in the share `MOST` of the postures, or
reaches `MOST` of the way to the largest radius if that is smaller."""

TWIN = 0.028
"""Obstacles are the same if their radii differ by less, as of a bone about a joint's axis, over the
typical lever arm of tendons."""

_GEOM = mujoco.mjtGeom
_ROUND = {
    int(_GEOM.mjGEOM_SPHERE): "sphere",
    int(_GEOM.mjGEOM_ELLIPSOID): "sphere",
    int(_GEOM.mjGEOM_CAPSULE): "cylinder",
    int(_GEOM.mjGEOM_CYLINDER): "cylinder",
}


@dataclass(frozen=True)
class RoundBody:
    """A round body that a tendon could wrap around.

    Attributes:
        kind: "joint" for a cylinder about the joint's axis, "geom" for a bone.
        name: name of the joint or geom.
        body: id of the model's body that carries it.
        shape: "cylinder" or "sphere".
        pos: centre in the frame of ``body``, shape (3,) [m].
        quat: orientation in the frame of ``body``, shape (4,); a cylinder lies along z.
        radius: radius in the model [m]; 0 for a joint.
        reach: half of the length along the axis [m].
    """

    kind: Literal["joint", "geom"]
    name: str
    body: int
    shape: str
    pos: Floats
    quat: Floats
    radius: float
    reach: float


@dataclass(frozen=True)
class Obstacle:
    """A round body between two successive sites of a tendon's path.

    Attributes:
        tendon: name of the tendon.
        between: names of the two sites.
        over: the round body.
        side: side on which the tendon passes: a unit vector in the frame of the body that carries
            ``over``, shape (3,).
        touching: smallest radius at which the straight tendon touches it in some posture [m].
        typical: radius of a typical fault [m].
        largest: largest radius; the sites must lie outside [m].
    """

    tendon: str
    between: tuple[str, str]
    over: RoundBody
    side: Floats
    touching: float
    typical: float
    largest: float


def obstacles(system: System) -> tuple[Obstacle, ...]:
    """Return all obstacles of a system's tendons."""
    if not system.tendons:
        return ()
    return _obstacles(system.model, system.tendons, typical_scales.lever_arm(system))


@lru_cache(maxsize=4)
def _obstacles(
    model: mujoco.MjModel, tendons: tuple[ActuatedTendon, ...], lever: float
) -> tuple[Obstacle, ...]:
    postures = _Postures(model)
    joints, bones = list(_joints(model)), list(_bones(model))
    found: list[Obstacle] = []
    for tendon in tendons:
        for between in _straight_segments(model, tendon.name):
            crossed = _crossed_joints(model, *between)
            if not crossed:
                continue
            near = [axis for axis in joints if axis.name in crossed] + bones
            of_segment: list[Obstacle] = []
            for over in near:
                new = _obstacle(model, postures, tendon.name, between, over, lever)
                if new is not None and not any(_are_twins(old, new, lever) for old in of_segment):
                    of_segment.append(new)
            found += of_segment
    return tuple(found)


def _are_twins(one: Obstacle, other: Obstacle, lever: float) -> bool:
    apart = max(abs(one.touching - other.touching), abs(one.largest - other.largest))
    return one.over.shape == other.over.shape and apart < TWIN * lever


class _Postures:
    """Poses of bodies and sites at sampled postures.

    Attributes:
        bodies: positions of bodies, shape (n, nbody, 3) [m].
        turns: rotation matrices of bodies, shape (n, nbody, 3, 3).
        sites: positions of sites, shape (n, nsite, 3) [m].
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        data = mujoco.MjData(model)
        bodies, turns, sites = [], [], []
        for share in Halton(max(1, model.njnt), scramble=False).random(POSTURES + 1)[1:]:
            data.qpos[:] = model.qpos0
            for j in range(model.njnt):
                span = _range(model, j)
                if span is not None:
                    data.qpos[model.jnt_qposadr[j]] = span[0] + share[j] * (span[1] - span[0])
            mujoco.mj_kinematics(model, data)
            bodies.append(data.xpos.copy())
            turns.append(data.xmat.reshape(-1, 3, 3).copy())
            sites.append(data.site_xpos.copy())
        self.bodies, self.turns, self.sites = np.array(bodies), np.array(turns), np.array(sites)

    def site_in_body(self, body: int, site: int) -> Floats:
        """Return the position of a site in the frame of a body, shape (n, 3) [m]."""
        return np.einsum(
            "nji,nj->ni", self.turns[:, body], self.sites[:, site] - self.bodies[:, body]
        )


def _range(model: mujoco.MjModel, joint: int) -> tuple[float, float] | None:
    """Return the range of a hinge or slide joint, 1 rad or 0.1 m about ``qpos0`` without limits."""
    reach = {int(mujoco.mjtJoint.mjJNT_HINGE): 1.0, int(mujoco.mjtJoint.mjJNT_SLIDE): 0.1}
    kind = int(model.jnt_type[joint])
    if kind not in reach:
        return None
    if model.jnt_limited[joint]:
        return float(model.jnt_range[joint, 0]), float(model.jnt_range[joint, 1])
    middle = float(model.qpos0[model.jnt_qposadr[joint]])
    return middle - reach[kind], middle + reach[kind]


def _straight_segments(model: mujoco.MjModel, tendon: str) -> Iterator[tuple[str, str]]:
    """Yield the pairs of successive sites in a tendon's path without a geom between them."""
    start = int(model.tendon_adr[model.tendon(tendon).id])
    site = int(mujoco.mjtWrap.mjWRAP_SITE)
    for i in range(start, start + int(model.tendon_num[model.tendon(tendon).id]) - 1):
        if model.wrap_type[i] == site and model.wrap_type[i + 1] == site:
            yield tuple(model.site(int(model.wrap_objid[k])).name for k in (i, i + 1))


def _crossed_joints(model: mujoco.MjModel, one: str, other: str) -> set[str]:
    """Return the joints between the bodies of two sites."""

    def above(site: str) -> set[str]:
        body, names = int(model.site(site).bodyid[0]), set()
        while body:
            first = int(model.body_jntadr[body])
            names |= {model.joint(j).name for j in range(first, first + model.body_jntnum[body])}
            body = int(model.body_parentid[body])
        return names

    return above(one) ^ above(other)


def _joints(model: mujoco.MjModel) -> Iterator[RoundBody]:
    """Yield a cylinder about the axis of each hinge joint."""
    for j in range(model.njnt):
        if int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_HINGE) and model.joint(j).name:
            quat = np.empty(4)
            mujoco.mju_quatZ2Vec(quat, model.jnt_axis[j])
            name, body = model.joint(j).name, int(model.jnt_bodyid[j])
            yield RoundBody("joint", name, body, "cylinder", model.jnt_pos[j], quat, 0.0, np.inf)


def _bones(model: mujoco.MjModel) -> Iterator[RoundBody]:
    """Yield a cylinder or sphere for each round geom."""
    for g in range(model.ngeom):
        shape, name = _ROUND.get(int(model.geom_type[g])), model.geom(g).name
        if shape is None or not name:
            continue
        size, body = model.geom_size[g], int(model.geom_bodyid[g])
        ellipsoid = int(model.geom_type[g]) == int(_GEOM.mjGEOM_ELLIPSOID)
        radius = float(size.mean() if ellipsoid else size[0])
        reach = float(size[1]) + radius if shape == "cylinder" else np.inf
        pos, quat = model.geom_pos[g], model.geom_quat[g]
        yield RoundBody("geom", name, body, shape, pos, quat, radius, reach)


def _obstacle(
    model: mujoco.MjModel,
    postures: _Postures,
    tendon: str,
    between: tuple[str, str],
    over: RoundBody,
    lever: float,
) -> Obstacle | None:
    """Return a round body as an obstacle of a segment; None if the segment rarely passes it.

    ``a`` and ``b`` are the ends of the segment in the plane of wrapping, and ``point`` is its
    nearest point to the axis or centre, at each posture.
    """
    ends = [postures.site_in_body(over.body, model.site(name).id) - over.pos for name in between]
    across = _planes(over, *ends)
    a, b = (np.einsum("nki,ni->nk", across, end) for end in ends)
    share = np.clip(np.sum(a * (a - b), axis=1) / np.sum((a - b) ** 2, axis=1), 0.0, 1.0)
    point = a + share[:, None] * (b - a)
    distance = np.linalg.norm(point, axis=1)
    largest = CLEAR * float(np.min(np.linalg.norm([a, b], axis=2)))
    passing = (share > 0) & (share < 1)
    limit = THICK * lever if over.kind == "joint" else over.radius + NEAR * lever
    along = (ends[0] + share[:, None] * (ends[1] - ends[0])) @ _axis(over)
    acting = passing & (distance < largest) & (distance < limit) & (np.abs(along) < over.reach)
    if np.mean(acting) < OFTEN:
        return None
    outward = np.einsum("nki,nk->ni", across, point / distance[:, None])[passing].mean(axis=0)
    side = outward / np.linalg.norm(outward)
    if np.mean(_on_other_side(a, b, np.einsum("nki,i->nk", across, side))) > OTHER_SIDE:
        return None
    touching = float(distance[passing].min())
    typical = min(
        float(np.quantile(distance[passing], MOST)) + LIFT * lever,
        touching + MOST * (largest - touching),
    )
    return Obstacle(tendon, between, over, side, touching, typical, largest)


def _axis(over: RoundBody) -> Floats:
    """Return the z axis of a round body in the frame of the body that carries it, shape (3,)."""
    axis = np.empty(3)
    mujoco.mju_rotVecQuat(axis, np.array([0.0, 0.0, 1.0]), over.quat)
    return axis


def _planes(over: RoundBody, a: Floats, b: Floats) -> Floats:
    """Return two unit vectors that span the plane of wrapping at each posture, (n, 2, 3)."""
    if over.shape == "cylinder":
        across = np.empty((2, 3))
        for row, unit in zip(across, np.eye(3), strict=False):
            mujoco.mju_rotVecQuat(row, unit, over.quat)
        return np.broadcast_to(across, (len(a), 2, 3))
    one = a / np.linalg.norm(a, axis=1)[:, None]
    other = b - np.sum(b * one, axis=1)[:, None] * one
    return np.stack([one, other / np.linalg.norm(other, axis=1)[:, None]], axis=1)


def _on_other_side(a: Floats, b: Floats, side: Floats) -> Bools:
    """Return whether the segment from a to b passes the origin on the side opposite to ``side``.

    All arguments have shape (n, 2); the result has shape (n,).
    """
    ahead = np.arctan2(side[:, 1], side[:, 0])
    angles = [np.arctan2(p[:, 1], p[:, 0]) - ahead for p in (a, b)]
    one, other = (np.mod(angle + np.pi, 2 * np.pi) - np.pi for angle in angles)
    return np.abs(one - other) > np.pi
