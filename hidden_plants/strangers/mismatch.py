"""Small mismatches between a real machine and its nominal model.

They are what every good model gets wrong, and no fault. Each is uniform between its half widths;
an unmodelled friction is uniform from zero to its width.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from hidden_plants.strangers.stranger import Stranger
from hidden_plants.types import Floats


@dataclass(frozen=True)
class Tolerances:
    """Half widths of the mismatches.

    Attributes:
        mass: of each link [1].
        centre: of each link's centre of mass, over its length, three axes [1].
        length: of each link, with what it carries [1].
        armature, damping, friction, stiffness: of each joint, over those of the model [1].
        gain, rate_gain: of each drive, over those of the model [1].
        site: of each site of a tendon, over the length of the shortest link, three axes [1].
        zero: of each encoder, over the travel of the joint or tendon [1].
        force_zero, force_scale: of each sensor of a force, over the drive's limit, and [1].
        inner_friction: dry friction before the sensor of a drive's force, over its limit [1].
        outer_friction: dry friction behind it, over the drive's limit [1].
    """

    mass: float = 0.02
    centre: float = 0.005
    length: float = 0.001
    armature: float = 0.05
    damping: float = 0.05
    friction: float = 0.05
    stiffness: float = 0.02
    gain: float = 0.01
    rate_gain: float = 0.02
    site: float = 0.0005
    zero: float = 0.0003
    force_zero: float = 0.001
    force_scale: float = 0.005
    inner_friction: float = 0.001
    outer_friction: float = 0.001


@dataclass(frozen=True)
class Mismatch:
    """Mismatches of one machine; each field holds those of `Tolerances` in their order."""

    mass: Floats
    centre: Floats
    length: Floats
    armature: Floats
    damping: Floats
    friction: Floats
    stiffness: Floats
    gain: Floats
    rate_gain: Floats
    site: Floats
    zero: Floats
    force_zero: Floats
    force_scale: Floats
    inner_friction: Floats
    outer_friction: Floats


POSITIVE = ("inner_friction", "outer_friction")
"""Mismatches that are not negative."""


def sites_of(stranger: Stranger) -> tuple[str, ...]:
    """Names of the sites of all tendons."""
    steps = (step for route in stranger.routes for step in route.path)
    return tuple(step for step in steps if not step.startswith("pulley/"))


def shapes(stranger: Stranger) -> dict[str, tuple[int, ...]]:
    """Shape of each mismatch of a machine; zero rows where it has no such element."""
    joints, drives = len(stranger.joints), len(stranger.moved)
    springs = joints if stranger.design.stiffness.any() else 0
    forces = drives if any(s.kind in ("force", "effort") for s in stranger.sensors) else 0
    fed_back = drives if stranger.law.rate.any() and stranger.traits.kind != "efforts" else 0
    return {
        "mass": (joints,),
        "centre": (joints, 3),
        "length": (joints,),
        "armature": (joints,),
        "damping": (joints,),
        "friction": (joints if stranger.design.friction.any() else 0,),
        "stiffness": (springs,),
        "gain": (0 if stranger.traits.kind == "efforts" else drives,),
        "rate_gain": (fed_back,),
        "site": (len(sites_of(stranger)), 3),
        "zero": (drives,),
        "force_zero": (forces,),
        "force_scale": (forces,),
        "inner_friction": (forces if stranger.traits.kind != "efforts" else 0,),
        "outer_friction": (drives,),
    }


def mismatch_size(stranger: Stranger) -> int:
    """Number of the mismatches of a machine."""
    return sum(int(np.prod(shape)) for shape in shapes(stranger).values())


def mismatch_at(stranger: Stranger, unit: Floats, tolerances: Tolerances | None = None) -> Mismatch:
    """Mismatches from numbers between -1 and 1.

    Args:
        stranger: nominal machine.
        unit: numbers (`mismatch_size`,); for a friction, -1 is none.
        tolerances: half widths; the defaults of `Tolerances` if None.
    """
    widths, found, start = tolerances or Tolerances(), {}, 0
    for field in fields(Tolerances):
        shape = shapes(stranger)[field.name]
        count = int(np.prod(shape))
        values = unit[start : start + count].reshape(shape)
        if field.name in POSITIVE:
            values = 0.5 * (values + 1.0)
        found[field.name] = getattr(widths, field.name) * values
        start += count
    return Mismatch(**found)


def sample_mismatch(stranger: Stranger) -> Mismatch:
    """Mismatches of the real machine of a seed and realisation."""
    rng = stranger.generator(1)
    return mismatch_at(stranger, rng.uniform(-1.0, 1.0, mismatch_size(stranger)))
