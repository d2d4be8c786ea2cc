"""A wire that is drawn straight where it runs over something round.

The round thing is a cylinder about a joint's axis, as a pulley or condyle, or has the axis or the
centre of a bone. The wire passes it on the side where it is drawn, held there by a side site. The
null radius is the one at which it touches the straight wire somewhere in the joints' ranges:
smaller ones do nothing.

MuJoCo wraps no tendon that has an armature. That of the wire, its motor's inertia, then goes to
the joints that it pulls, by its lever arms in the middle of their ranges.
"""

from __future__ import annotations

from functools import partial

import mujoco

from reality_gap.causes.base import Cause, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import encoder_zero, lever_arms, obstacles, tendon_paths
from reality_gap.causes.support.new_elements import add_geom, add_site
from reality_gap.causes.support.obstacles import Obstacle
from reality_gap.study.system import System

SHAPES = {"cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER, "sphere": mujoco.mjtGeom.mjGEOM_SPHERE}
SIDE = 1.5
"""How far out the side site lies [radii]."""
SHARES = (0.15, 0.4, 1.0)
"""Sizes of a bone to start from: a wire that touches it sooner takes another path."""
LENGTH = 0.01
"""Half of a cylinder's, as drawn; for wires it is endless [m]."""


def _location(obstacle: Obstacle) -> Location:
    start, end = obstacle.between
    over = f"{obstacle.over.kind} {obstacle.over.name}"
    return Location("tendon", (obstacle.tendon,), f"from {start} to {end} over {over}")


def _locations(system: System) -> tuple[Location, ...]:
    return tuple(_location(obstacle) for obstacle in obstacles.obstacles(system))


def _obstacle(system: System, location: Location) -> Obstacle:
    return next(o for o in obstacles.obstacles(system) if _location(o) == location)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    it = _obstacle(system, location)
    step = it.typical - it.touching
    starts = tuple(min(it.touching + share * step, it.largest) for share in SHARES)
    hints = SearchHints(starts=starts)
    return (Parameter("radius", "m", step, 0.0, it.touching, it.largest, it.touching, hints),)


def _geometry(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    it, radius = _obstacle(system, location), values["radius"]
    if radius <= it.touching:
        return
    over = it.over
    element = spec.joint(over.name) if over.kind == "joint" else spec.geom(over.name)
    body, name = element.parent, f"{it.tendon}_over_{over.name}_from_{it.between[0]}"
    geom = add_geom(
        body,
        name=name,
        type=SHAPES[over.shape],
        pos=over.pos,
        quat=over.quat,
        size=[radius, LENGTH, 0.0],
        mass=0.0,
        contype=0,
        conaffinity=0,
        group=4,
    )
    side = add_site(body, name=f"{name}_side", pos=over.pos + SIDE * radius * it.side, group=4)
    _free_of_armature(spec, system, it.tendon)
    tendon_paths.go_round(spec, it.tendon, it.between, geom.name, side.name)


def _free_of_armature(spec: mujoco.MjSpec, system: System, tendon: str) -> None:
    inertia = spec.tendon(tendon).armature
    if inertia > 0:
        spec.tendon(tendon).armature = 0.0
        for joint, arm in lever_arms.lever_arms(system, tendon).items():
            spec.joint(joint).armature += inertia * arm**2


CAUSE = Cause(
    id="missing_wrapping",
    title="missing wrapping",
    explanation="A wire that is drawn straight runs over something, and keeps its lever arm there.",
    locations=_locations,
    parameters=_parameters,
    edit=partial(encoder_zero.edit, _geometry),
    attach=partial(encoder_zero.attach, _geometry),
    fine=True,
)
