"""What a wire that is drawn straight could run over: the axes of joints, and bones.

Everything is looked at over postures that fill the ranges of all joints, in the plane in which a
wire would wrap: across a cylinder's axis, or through a sphere's centre.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.stats.qmc import Halton

from reality_gap.study.system import ActuatedTendon, System
from reality_gap.types import Floats

POSTURES = 64
NEAR = 0.025
"""A bone whose surface is farther from a straight wire is not in its way [m]."""
THICK = 0.04
"""A joint whose axis is farther from a straight wire is not in its way [m]."""
OFTEN = 0.1
"""In so large a share of the postures a wire must pass something that is in its way."""
ASTRAY = 0.05
"""In so large a share of the postures it may pass on the other side."""
CLEAR = 0.95
"""Share of the distance to a wire's nearer end that a radius may reach: ends lie outside."""
MOST, LIFT = 0.8, 0.003
"""A typical radius lifts the wire in most of the postures by this much [m], if its ends allow."""

TWIN = 0.001
"""A bone about a joint's axis, whose radii differ by less from the joint's, is the same [m]."""

_GEOM = mujoco.mjtGeom
_ROUND = {
    int(_GEOM.mjGEOM_SPHERE): "sphere",
    int(_GEOM.mjGEOM_ELLIPSOID): "sphere",
    int(_GEOM.mjGEOM_CAPSULE): "cylinder",
    int(_GEOM.mjGEOM_CYLINDER): "cylinder",
}


@dataclass(frozen=True)
class Body:
    """Something round that could be in a wire's way.

    Attributes:
        kind, name: of the model's element.
        body: id of the body that carries it.
        shape: "cylinder" or "sphere".
        pos, quat: in the body's frame (3,) [m], (4,); a cylinder lies along z.
        radius: drawn [m]; 0 for a joint.
        reach: how far along its axis it reaches from the middle [m].
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
    """Something round between two points of a wire's path.

    Attributes:
        tendon: name.
        between: names of the two sites.
        over: what the wire would run over.
        side: where the wire passes: a unit vector in the frame of ``over``'s body (3,).
        touching: radius at which it touches the straight wire in some posture [m].
        typical, largest: radius that shows, and that the wire's ends allow [m].
    """

    tendon: str
    between: tuple[str, str]
    over: Body
    side: Floats
    touching: float
    typical: float
    largest: float


def obstacles(system: System) -> tuple[Obstacle, ...]:
    """All that could be in the way of a system's wires."""
    return _all(system.model, system.tendons)


@lru_cache(maxsize=4)
def _all(model: mujoco.MjModel, tendons: tuple[ActuatedTendon, ...]) -> tuple[Obstacle, ...]:
    postures = _Postures(model)
    joints, bones = list(_joints(model)), list(_bones(model))
    found: list[Obstacle] = []
    for tendon in tendons:
        for between in _gaps(model, tendon.name):
            crossed = _crossed(model, *between)
            if not crossed:
                continue
            near = [axis for axis in joints if axis.name in crossed] + bones
            here: list[Obstacle] = []
            for over in near:
                new = _look(model, postures, tendon.name, between, over)
                if new is not None and not any(_twins(old, new) for old in here):
                    here.append(new)
            found += here
    return tuple(found)


def _twins(one: Obstacle, other: Obstacle) -> bool:
    apart = max(abs(one.touching - other.touching), abs(one.largest - other.largest))
    return one.over.shape == other.over.shape and apart < TWIN


class _Postures:
    """Poses of bodies and sites at postures: (n, nbody, 3), (n, nbody, 3, 3), (n, nsite, 3)."""

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

    def seen_from(self, body: int, site: int) -> Floats:
        """A site in a body's frame (n, 3)."""
        return np.einsum(
            "nji,nj->ni", self.turns[:, body], self.sites[:, site] - self.bodies[:, body]
        )


def _range(model: mujoco.MjModel, joint: int) -> tuple[float, float] | None:
    """Of a hinge or slide; about ``qpos0`` where there are no limits."""
    reach = {int(mujoco.mjtJoint.mjJNT_HINGE): 1.0, int(mujoco.mjtJoint.mjJNT_SLIDE): 0.1}
    kind = int(model.jnt_type[joint])
    if kind not in reach:
        return None
    if model.jnt_limited[joint]:
        return float(model.jnt_range[joint, 0]), float(model.jnt_range[joint, 1])
    middle = float(model.qpos0[model.jnt_qposadr[joint]])
    return middle - reach[kind], middle + reach[kind]


def _gaps(model: mujoco.MjModel, tendon: str) -> Iterator[tuple[str, str]]:
    """Sites that follow each other in a path with nothing between them."""
    start = int(model.tendon_adr[model.tendon(tendon).id])
    site = int(mujoco.mjtWrap.mjWRAP_SITE)
    for i in range(start, start + int(model.tendon_num[model.tendon(tendon).id]) - 1):
        if model.wrap_type[i] == site and model.wrap_type[i + 1] == site:
            yield tuple(model.site(int(model.wrap_objid[k])).name for k in (i, i + 1))


def _crossed(model: mujoco.MjModel, one: str, other: str) -> set[str]:
    """Joints between the bodies of two sites."""

    def above(site: str) -> set[str]:
        body, names = int(model.site(site).bodyid[0]), set()
        while body:
            first = int(model.body_jntadr[body])
            names |= {model.joint(j).name for j in range(first, first + model.body_jntnum[body])}
            body = int(model.body_parentid[body])
        return names

    return above(one) ^ above(other)


def _joints(model: mujoco.MjModel) -> Iterator[Body]:
    for j in range(model.njnt):
        if int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_HINGE) and model.joint(j).name:
            quat = np.empty(4)
            mujoco.mju_quatZ2Vec(quat, model.jnt_axis[j])
            name, body = model.joint(j).name, int(model.jnt_bodyid[j])
            yield Body("joint", name, body, "cylinder", model.jnt_pos[j], quat, 0.0, np.inf)


def _bones(model: mujoco.MjModel) -> Iterator[Body]:
    for g in range(model.ngeom):
        shape, name = _ROUND.get(int(model.geom_type[g])), model.geom(g).name
        if shape is None or not name:
            continue
        size, body = model.geom_size[g], int(model.geom_bodyid[g])
        ellipsoid = int(model.geom_type[g]) == int(_GEOM.mjGEOM_ELLIPSOID)
        radius = float(size.mean() if ellipsoid else size[0])
        reach = float(size[1]) + radius if shape == "cylinder" else np.inf
        pos, quat = model.geom_pos[g], model.geom_quat[g]
        yield Body("geom", name, body, shape, pos, quat, radius, reach)


def _look(
    model: mujoco.MjModel, postures: _Postures, tendon: str, between: tuple[str, str], over: Body
) -> Obstacle | None:
    """A wire's gap beside something round, at all postures; None if that is not in its way."""
    ends = [postures.seen_from(over.body, model.site(name).id) - over.pos for name in between]
    across = _planes(over, *ends)
    a, b = (np.einsum("nki,ni->nk", across, end) for end in ends)
    share = np.clip(np.sum(a * (a - b), axis=1) / np.sum((a - b) ** 2, axis=1), 0.0, 1.0)
    point = a + share[:, None] * (b - a)
    distance = np.linalg.norm(point, axis=1)
    allowed = CLEAR * float(np.min(np.linalg.norm([a, b], axis=2)))
    passing = (share > 0) & (share < 1)
    limit = THICK if over.kind == "joint" else over.radius + NEAR
    along = (ends[0] + share[:, None] * (ends[1] - ends[0])) @ _axis(over)
    acting = passing & (distance < allowed) & (distance < limit) & (np.abs(along) < over.reach)
    if np.mean(acting) < OFTEN:
        return None
    outward = np.einsum("nki,nk->ni", across, point / distance[:, None])[passing].mean(axis=0)
    side = outward / np.linalg.norm(outward)
    if np.mean(_astray(a, b, np.einsum("nki,i->nk", across, side))) > ASTRAY:
        return None
    touching = float(distance[passing].min())
    typical = min(
        float(np.quantile(distance[passing], MOST)) + LIFT,
        touching + MOST * (allowed - touching),
    )
    return Obstacle(tendon, between, over, side, touching, typical, allowed)


def _axis(over: Body) -> Floats:
    axis = np.empty(3)
    mujoco.mju_rotVecQuat(axis, np.array([0.0, 0.0, 1.0]), over.quat)
    return axis


def _planes(over: Body, a: Floats, b: Floats) -> Floats:
    """Two unit vectors that span the plane of wrapping, at every posture (n, 2, 3)."""
    if over.shape == "cylinder":
        across = np.empty((2, 3))
        for row, unit in zip(across, np.eye(3), strict=False):
            mujoco.mju_rotVecQuat(row, unit, over.quat)
        return np.broadcast_to(across, (len(a), 2, 3))
    one = a / np.linalg.norm(a, axis=1)[:, None]
    other = b - np.sum(b * one, axis=1)[:, None] * one
    return np.stack([one, other / np.linalg.norm(other, axis=1)[:, None]], axis=1)


def _astray(a: Floats, b: Floats, side: Floats) -> NDArray[np.bool_]:
    """Whether the straight line from a to b passes the origin on the side that is not ``side``."""
    ahead = np.arctan2(side[:, 1], side[:, 0])
    angles = [np.arctan2(p[:, 1], p[:, 0]) - ahead for p in (a, b)]
    one, other = (np.mod(angle + np.pi, 2 * np.pi) - np.pi for angle in angles)
    return np.abs(one - other) > np.pi
