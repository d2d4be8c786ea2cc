"""Missing wrapping: a tendon wraps around a round object where the nominal model has it straight.

The object is a cylinder about a joint's axis, such as a pulley or a condyle, or a cylinder or
sphere about the axis or centre of a bone; see `reality_gap.causes.support.obstacles`. The tendon
passes it on the same side as in the nominal model, which a side site ensures. The null value of the
radius is the one at which the object touches the straight tendon at some posture; smaller radii
have no effect.

MuJoCo does not allow wrapping for a tendon with an armature. The armature ``m``, which is the
inertia of the motor, is then moved to the joints that the tendon crosses: ``m r_j^2`` with the
lever arm ``r_j`` in the middle of the joints' ranges.
"""

from __future__ import annotations

from functools import partial

import mujoco

from reality_gap.causes.base import Cause, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import (
    encoder_zero,
    lever_arms,
    obstacles,
    tendon_paths,
    typical_scales,
)
from reality_gap.causes.support.new_elements import add_geom, add_site
from reality_gap.causes.support.obstacles import Obstacle
from reality_gap.study.system import System

SHAPES = {"cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER, "sphere": mujoco.mjtGeom.mjGEOM_SPHERE}
SIDE = 1.5
"""Distance of the side site from the axis or centre, in radii."""
SHARES = (0.15, 0.4, 1.0)
"""Radii from which fits start, as shares between the touching (0) and the typical radius (1). The
effect is not linear: a larger object touches the tendon at more postures."""
LENGTH = 0.28
"""Half of a cylinder's length in pictures over the lever arm of tendons; for tendons it is
infinitely long."""


def _location(obstacle: Obstacle) -> Location:
    start, end = obstacle.between
    over = f"{obstacle.over.kind} {obstacle.over.name}"
    return Location("tendon", (obstacle.tendon,), f"from {start} to {end} over {over}")


def _locations(system: System) -> tuple[Location, ...]:
    return tuple(_location(obstacle) for obstacle in obstacles.obstacles(system))


def _obstacle(system: System, location: Location) -> Obstacle:
    return next(o for o in obstacles.obstacles(system) if _location(o) == location)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    obstacle = _obstacle(system, location)
    touching, largest = obstacle.touching, obstacle.largest
    step = obstacle.typical - touching
    starts = tuple(min(touching + share * step, largest) for share in SHARES)
    hints = SearchHints(starts=starts)
    return (Parameter("radius", "m", step, 0.0, touching, largest, touching, hints),)


def _geometry(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    obstacle, radius = _obstacle(system, location), values["radius"]
    if radius <= obstacle.touching:
        return
    over, tendon = obstacle.over, obstacle.tendon
    element = spec.joint(over.name) if over.kind == "joint" else spec.geom(over.name)
    body, name = element.parent, f"{tendon}_over_{over.name}_from_{obstacle.between[0]}"
    geom = add_geom(
        body,
        name=name,
        type=SHAPES[over.shape],
        pos=over.pos,
        quat=over.quat,
        size=[radius, LENGTH * typical_scales.lever_arm(system), 0.0],
        mass=0.0,
        contype=0,
        conaffinity=0,
        group=4,
    )
    outside = over.pos + SIDE * radius * obstacle.side
    side = add_site(body, name=f"{name}_side", pos=outside, group=4)
    _move_armature_to_joints(spec, system, tendon)
    tendon_paths.wrap_around(spec, tendon, obstacle.between, geom.name, side.name)


def _move_armature_to_joints(spec: mujoco.MjSpec, system: System, tendon: str) -> None:
    inertia = spec.tendon(tendon).armature
    if inertia > 0:
        spec.tendon(tendon).armature = 0.0
        for joint, arm in lever_arms.lever_arms(system, tendon).items():
            spec.joint(joint).armature += inertia * arm**2


CAUSE = Cause(
    id="missing_wrapping",
    title="missing wrapping",
    explanation="A tendon that is straight in the model wraps around a joint or bone.",
    locations=_locations,
    parameters=_parameters,
    edit=partial(encoder_zero.edit_zeroed, _geometry),
    attach=partial(encoder_zero.attach_zeroed, _geometry),
    fine=True,
)
