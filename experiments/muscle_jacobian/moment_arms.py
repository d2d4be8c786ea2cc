"""Moment arms of a map and true ones, along sweeps of every joint through its range.

A sweep moves one joint through its range from a random posture. It has the moment arms
dl_i/dtheta_j of all muscles i whose network has the swept joint j as input: by the analytic
Jacobian of the map, by a difference, by the paper's quadratic through five points (sec. II-B), and
the true ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from jmm_agent.mapping.group_map import METRES
from jmm_agent.mapping.joint_muscle_map import QUADRATIC_STEP, JointMuscleMap
from jmm_agent.nominal_model import NominalModel
from jmm_agent.types import Floats

Arms = Callable[[Floats], Floats]
"""Posture, shape (n,) [rad] -> dl/dq, shape (m, n) [m/rad]."""

ANALYTIC, QUADRATIC, TRUE = "analytic", "quadratic", "true"
KINDS = (ANALYTIC, QUADRATIC)

STEP = float(np.deg2rad(2.5))
"""Distance of two points of a sweep [rad]."""

LEAST = 5
"""Least number of points of a sweep."""

DIFFERENCE = np.deg2rad([-0.05, 0.05])
FIVE_POINTS = QUADRATIC_STEP * np.array([-2.0, -1.0, 1.0, 2.0])
"""Offsets of the lengths for the two numerical derivatives of the paper [rad]. The middle one of
the five points has no weight in the slope."""


class Sweep(NamedTuple):
    """Sweeps of one joint from several postures.

    Attributes:
        joint: its index.
        postures: P sweeps of K points at distances of `STEP`, shape (P, K, n) [rad].
    """

    joint: int
    postures: Floats


def sweeps(nominal: NominalModel, count: int, rng: np.random.Generator) -> list[Sweep]:
    """Sweeps of every joint, each from ``count`` postures, uniform in the joint ranges."""
    result = []
    for joint in range(len(nominal.joints)):
        low, high = nominal.lower[joint], nominal.upper[joint]
        points = 1 + int((high - low) / STEP + 1e-9)
        start = rng.uniform(nominal.lower, nominal.upper, (count, len(nominal.joints)))
        postures = np.repeat(start[:, None], points, axis=1)
        postures[:, :, joint] = low + STEP * np.arange(points)
        result.append(Sweep(joint, postures))
    return result


def slope(jmm: JointMuscleMap, postures: Floats, joint: int, offsets: Floats) -> Floats:
    """Slope of the least-squares parabola of the lengths, sum(d l(d)) / sum(d d).

    Args:
        jmm: the map.
        postures: joint angles, shape (B, n) [rad].
        joint: index of the joint.
        offsets: symmetric offsets d of the joint [rad].

    Returns:
        Slopes, shape (B, m) [m/rad].
    """
    points = np.repeat(postures[:, None], len(offsets), axis=1)
    points[:, :, joint] += offsets
    lengths = jmm.lengths(points.reshape(-1, postures.shape[1]))
    weights = offsets / np.sum(np.square(offsets))
    return np.einsum("bom,o->bm", lengths.reshape(len(postures), len(offsets), -1), weights)


def by_map(jmm: JointMuscleMap, postures: Floats, joint: int, kind: str) -> Floats:
    """Moment arms about one joint by one of the `KINDS`, shape (B, m) [m/rad]."""
    if kind == QUADRATIC:
        return slope(jmm, postures, joint, FIVE_POINTS)
    return jmm.jacobian(postures)[:, :, joint]


class Curves(NamedTuple):
    """Moment arms of one group's muscles along the sweeps of one joint.

    Attributes:
        group: its name.
        joint: index of the swept joint.
        arms: moment arms, shape (P, K, k) [mm/rad], by the `KINDS` of the map, and `TRUE`.
    """

    group: str
    joint: int
    arms: Mapping[str, Floats]


def curves(jmm: JointMuscleMap, true: Arms, swept: Sequence[Sweep]) -> Iterator[Curves]:
    """Moment arms along all sweeps, by group and joint that the group's network has as input."""
    for joint, postures in swept:
        flat = postures.reshape(-1, postures.shape[-1])
        found = {kind: by_map(jmm, flat, joint, kind) for kind in KINDS}
        found[TRUE] = np.array([true(posture)[:, joint] for posture in flat])
        shaped = {
            kind: (arms / METRES).reshape(*postures.shape[:2], -1) for kind, arms in found.items()
        }
        for group in jmm.groups:
            if joint in group.joint_index:
                chosen = {kind: arms[:, :, group.muscle_index] for kind, arms in shaped.items()}
                yield Curves(group.name, joint, chosen)


def inner(found: Iterable[Curves]) -> Iterator[Curves]:
    """Parts of the sweeps where all five points of the quadratic are in the range of the joint."""
    edge = round(float(FIVE_POINTS.max()) / STEP)
    for curves in found:
        if curves.arms[TRUE].shape[1] - 2 * edge >= LEAST:
            yield curves._replace(
                arms={kind: arms[:, edge:-edge] for kind, arms in curves.arms.items()}
            )
