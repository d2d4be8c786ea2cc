"""Paths of tendons: shifted attachments, and wrapping over bones that the nominal model lacks.

Parameters and amplitudes:

* attachment_shift: the site moves by ``x, y, z`` [m] in its body's frame.
* missing_wrapping: the tendon wraps over a round bone of ``radius`` [m]. The amplitude is radius
  minus ``clearance`` [m], the smallest distance of the straight tendon from the bone's centre or
  axis. It is bounded so that the tendon touches the bone within the motions.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from hidden_plants.arm_motion import HOME, REACH
from hidden_plants.machine import Machine
from hidden_plants.mechanisms.mechanism import (
    Mechanism,
    Shape,
    Structure,
    along,
    random_direction,
    shapes_of,
    vector,
)
from hidden_plants.robot import Robot
from hidden_plants.secret import Effect
from hidden_plants.types import Floats

SHIFTS_PER_SITE = 3
"""Directions in which each site may shift."""


def _shifts(machine: Machine) -> list[Structure]:
    """Every site of the tendons' paths, each with a few directions."""
    structures = []
    for site in machine.sites:
        rng = shapes_of("attachment_shift", site)
        for _ in range(SHIFTS_PER_SITE):
            structures.append(Structure("attachment_shift", (site,), random_direction(rng)))
    return structures


def _tune_shift(robot: Robot, effect: Effect) -> None:
    for name in effect.elements:
        robot.model.site_pos[robot.model.site(name).id] += vector(effect)


@dataclass(frozen=True)
class Bone:
    """A round bone that a tendon may wrap over.

    Attributes:
        body: its body; "world" for the trunk.
        before: first site of the tendon after the bone.
        centre: in the frame of the body [m].
        axis: of a cylinder, in the frame of the body; None for a sphere.
    """

    body: str
    before: str
    centre: tuple[float, float, float]
    axis: tuple[float, float, float] | None


TROCHLEA = (0.0057, 0.0114, -0.2698)
HUMERAL_HEAD = (-0.003, 0.002, 0.005)
RIBS = (-0.03, -0.06, -0.15)
ACROSS, UP = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
BONES = {
    "elbow": {
        "biceps": Bone("humerus", "biceps_2", TROCHLEA, ACROSS),
        "triceps": Bone("humerus", "triceps_2", TROCHLEA, ACROSS),
    },
    "arm": {
        "biceps": Bone("humerus", "biceps_2", TROCHLEA, ACROSS),
        "triceps": Bone("humerus", "triceps_2", TROCHLEA, ACROSS),
        "delt_mid": Bone("humerus", "delt_mid_2", HUMERAL_HEAD, None),
        "delt_post": Bone("humerus", "delt_post_2", HUMERAL_HEAD, None),
        "pec_major": Bone("world", "pec_major_1", RIBS, UP),
        "lat_dorsi": Bone("world", "lat_dorsi_2", RIBS, UP),
    },
}
"""Bones by machine and tendon."""
TOUCH = 0.0015
"""Margin of the radius above the tendon's smallest and below its sites' smallest distance [m]."""


def clearances(machine: Machine, tendon: str, qpos: Floats) -> Floats:
    """Compute the distances of the straight tendon and of its sites from the bone.

    Args:
        machine: nominal model.
        tendon: name of a tendon in `BONES`.
        qpos: postures (k, joints) [rad].

    Returns:
        Distances from the bone's centre or axis (k, 2) [m]: the tendon's and its nearest site's.
    """
    bone = BONES[machine.name][tendon]
    path = machine.paths[machine.tendons.index(tendon)]
    first = path[path.index(bone.before) - 1]
    data = mujoco.MjData(machine.model)
    found = np.empty((len(qpos), 2))
    for row, posture in zip(found, qpos, strict=True):
        data.qpos[:] = posture
        mujoco.mj_kinematics(machine.model, data)
        frame = data.body(bone.body).xmat.reshape(3, 3)
        centre = data.body(bone.body).xpos + frame @ np.array(bone.centre)
        ends = np.array([data.site(first).xpos - centre, data.site(bone.before).xpos - centre])
        if bone.axis is not None:
            axis = frame @ np.array(bone.axis)
            ends -= np.outer(ends @ axis, axis)
        span = ends[1] - ends[0]
        share = np.clip(-(ends[0] @ span) / (span @ span), 0.0, 1.0)
        row[0] = np.linalg.norm(ends[0] + share * span)
        row[1] = np.linalg.norm(ends, axis=1).min()
    return found


def _postures(machine: Machine) -> Floats:
    """Postures in the range of the motions (k, joints) [rad]."""
    if machine.name == "elbow":
        return np.linspace(0.25, 1.85, 33)[:, None]
    rng = shapes_of("missing_wrapping", machine.name)
    home, reach = (np.array([row.get(j, 0.0) for j in machine.joints]) for row in (HOME, REACH))
    postures: Floats = home + 1.2 * reach * rng.uniform(-1.0, 1.0, (400, len(home)))
    return np.deg2rad(postures)


def _wraps(machine: Machine) -> list[Structure]:
    """Tendons that a bone can touch within the motions without enclosing their sites."""
    structures = []
    zero = np.array(machine.model.qpos0)[None]
    moved = _postures(machine)
    for tendon in BONES[machine.name]:
        in_motion, at_zero = clearances(machine, tendon, moved), clearances(machine, tendon, zero)
        clearance = round(float(min(in_motion[:, 0].min(), at_zero[0, 0])), 5)
        largest = float(min(in_motion[:, 1].min(), at_zero[0, 1]))
        shape = {
            "clearance": clearance,
            "least": round(float(in_motion[:, 0].min()) + TOUCH - clearance, 5),
            "most": round(largest - TOUCH - clearance, 5),
            "on_arm": float(machine.name == "arm"),
        }
        if shape["least"] < shape["most"]:
            structures.append(Structure("missing_wrapping", (tendon,), shape))
    return structures


def _radius(shape: Shape, amplitude: float) -> dict[str, float]:
    return {**shape, "radius": shape["clearance"] + amplitude}


def _wrap(spec: mujoco.MjSpec, effect: Effect) -> None:
    """Add the bone and let the tendon wrap over it."""
    table = BONES["arm" if effect.parameters["on_arm"] else "elbow"]
    for name in effect.elements:
        bone, kinds = table[name], mujoco.mjtGeom
        geom = spec.body(bone.body).add_geom(
            name=f"bone_of_{name}",
            type=kinds.mjGEOM_SPHERE if bone.axis is None else kinds.mjGEOM_CYLINDER,
            pos=bone.centre,
            size=[effect.parameters["radius"], 0.05, 0.0],
            mass=0.0,
            contype=0,
            conaffinity=0,
        )
        if bone.axis is not None:
            mujoco.mju_quatZ2Vec(geom.quat, np.array(bone.axis))
        _rebuild_tendons(spec, name, bone.before, geom.name)


def _rebuild_tendons(spec: mujoco.MjSpec, wrapped: str, before: str, bone: str) -> None:
    """Create all tendons again, in order; ``wrapped`` meets ``bone`` before the site ``before``."""
    paths = {
        tendon.name: ([wrap.target.name for wrap in tendon.path], float(tendon.damping[0]))
        for tendon in spec.tendons
    }
    for tendon in list(spec.tendons):
        spec.delete(tendon)
    for name, (sites, damping) in paths.items():
        tendon = spec.add_tendon(name=name)
        tendon.damping[0] = damping
        for site in sites:
            if name == wrapped and site == before:
                tendon.wrap_geom(bone, "")
            tendon.wrap_site(site)


MECHANISMS = (
    Mechanism(
        id="attachment_shift",
        unit="m",
        typical=3e-3,
        bound=0.03,
        structures=_shifts,
        parameters=along,
        tune=_tune_shift,
    ),
    Mechanism(
        id="missing_wrapping",
        unit="m",
        typical=0.012,
        bound=0.04,
        structures=_wraps,
        parameters=_radius,
        reshape=_wrap,
    ),
)
