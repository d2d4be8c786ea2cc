"""Objects of the laboratory: on the table, and between the camera and the hand."""

from __future__ import annotations

import mujoco
import numpy as np

from experiments.hand_detector.patterns import Random
from experiments.hand_detector.scene import BEFORE, COVERS, FAR, ITEMS
from jmm_agent.types import Floats

BOX, CYLINDER, CAPSULE, SPHERE = (
    mujoco.mjtGeom.mjGEOM_BOX,
    mujoco.mjtGeom.mjGEOM_CYLINDER,
    mujoco.mjtGeom.mjGEOM_CAPSULE,
    mujoco.mjtGeom.mjGEOM_SPHERE,
)
KINDS = ("book", "box", "cup", "tool", "cable", "ball", "block", "post")
"""Objects on the table."""


def scatter(model: mujoco.MjModel, rng: Random) -> None:
    """Put some objects on the table, perhaps a screen behind it, and take the others away."""
    table = model.body("table").pos
    size = model.geom("table_top").size
    count = int(rng.choice([0, 3, 6, ITEMS], p=[0.15, 0.3, 0.3, 0.25]))
    for number in range(ITEMS):
        name = f"item_{number}"
        if number >= count:
            model.geom(name).pos[:] = FAR
            continue
        kind = str(rng.choice(KINDS))
        shape, dimensions, lying = _object(rng, kind)
        height = dimensions[0] if lying else dimensions[2 if shape == BOX else 1]
        height = dimensions[0] if shape == SPHERE else height
        x, y = table[:2] + rng.uniform(-0.95, 0.95, 2) * size[:2]
        _put(model, name, shape, dimensions, (x, y, table[2] + height), rng, lying)
    _put_screen(model, rng, float(table[0] + size[0]), float(table[2]))


def _object(rng: Random, kind: str) -> tuple[mujoco.mjtGeom, Floats, bool]:
    """Shape, size (3,) [m] and whether the object lies on its side."""
    u = rng.uniform
    sizes: dict[str, tuple[mujoco.mjtGeom, tuple[float, float, float], bool]] = {
        "book": (BOX, (u(0.05, 0.12), u(0.07, 0.15), u(0.005, 0.02)), False),
        "box": (BOX, (u(0.02, 0.08), u(0.02, 0.08), u(0.02, 0.10)), False),
        "cup": (CYLINDER, (u(0.025, 0.045), u(0.03, 0.09), 0.0), False),
        "tool": (CAPSULE, (u(0.006, 0.014), u(0.05, 0.12), 0.0), True),
        "cable": (CAPSULE, (u(0.003, 0.006), u(0.15, 0.4), 0.0), True),
        "ball": (SPHERE, (u(0.015, 0.05), 0.0, 0.0), False),
        "block": (BOX, (u(0.008, 0.015), u(0.01, 0.04), u(0.01, 0.06)), False),
        "post": (CYLINDER, (u(0.006, 0.02), u(0.06, 0.18), 0.0), False),
    }
    shape, size, lying = sizes[kind]
    return shape, np.array(size), lying


def _put(
    model: mujoco.MjModel,
    name: str,
    shape: mujoco.mjtGeom,
    size: Floats,
    position: tuple[float, float, float] | Floats,
    rng: Random,
    lying: bool,
) -> None:
    """Put an object somewhere, turned about the vertical."""
    geom, turn = model.geom(name), rng.uniform(-np.pi, np.pi)
    model.geom_type[geom.id] = int(shape)
    geom.size[:], geom.pos[:] = size, position
    quaternion, upright = np.zeros(4), np.array([1.0, 0.0, 0.0, 0.0])
    if lying:
        mujoco.mju_axisAngle2Quat(upright, np.array([0.0, 1.0, 0.0]), np.pi / 2)
    about = np.zeros(4)
    mujoco.mju_axisAngle2Quat(about, np.array([0.0, 0.0, 1.0]), turn)
    mujoco.mju_mulQuat(quaternion, about, upright)
    geom.quat[:] = quaternion
    model.geom_matid[geom.id] = model.material(f"cover_{rng.integers(COVERS)}").id


def _put_screen(model: mujoco.MjModel, rng: Random, x: float, height: float) -> None:
    """Stand a screen at the far end of the table in a third of the frames."""
    screen = model.geom("screen")
    if rng.uniform() > 1 / 3:
        screen.pos[:] = FAR
        return
    half = rng.uniform((0.15, 0.10), (0.28, 0.18))
    screen.size[:] = (half[0], half[1], 0.01)
    screen.pos[:] = (x + rng.uniform(-0.15, 0.1), rng.uniform(-0.45, 0.2), height + half[1] + 0.06)
    screen.quat[:] = (0.5, 0.5, -0.5, -0.5)


def clear_before(model: mujoco.MjModel) -> None:
    """Take away the objects between camera and hand."""
    for number in range(BEFORE):
        model.geom(f"before_{number}").pos[:] = FAR


def put_before(model: mujoco.MjModel, rng: Random, eye: Floats, hand: Floats, cover: float) -> None:
    """Put an object between camera and hand: a cable, a pole, a panel, a ball.

    Args:
        model: the scene.
        rng: chooses the object.
        eye: position of the camera (3,) [m].
        hand: middle of the hand (3,) [m].
        cover: size of the object as seen from the camera, over that of the hand [1].
    """
    share = rng.uniform(0.35, 0.8)
    radius = 0.06 * share * cover
    position = eye + share * (hand - eye) + share * 0.05 * rng.standard_normal(3)
    shapes = {
        "pole": (CAPSULE, (0.35 * radius, 0.5, 0.0)),
        "panel": (BOX, (radius, radius * rng.uniform(0.5, 1.5), 0.003)),
        "box": (BOX, tuple(radius * rng.uniform(0.6, 1.0, 3))),
        "ball": (SPHERE, (radius, 0.0, 0.0)),
        "cylinder": (CYLINDER, (0.7 * radius, radius, 0.0)),
    }
    shape, size = shapes[str(rng.choice(list(shapes)))]
    _put(model, "before_0", shape, np.array(size), position, rng, bool(rng.uniform() < 0.5))
    turn = rng.standard_normal(4)
    model.geom("before_0").quat[:] = turn / np.linalg.norm(turn)
