"""The scene of the judge's frames: the can's table, and a laboratory around it.

The model is compiled once. What changes from frame to frame, colours, textures, lights and objects,
are numbers of the model, which `Studio` sets.
"""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.assets import asset_path
from kengoro_env.robot.model_file import load_spec

SCENE = "mjcf/kengoro_arm/can_grasp.xml"
HAND, CAN, EYE = "hand", "can", "eye"
"""Names of the hand's and the can's body and of the camera."""
MARKER = "marker_plate"
"""Geom of the hand's marker, which is not there."""

ITEMS, BEFORE, LAMPS, WALLS = 16, 2, 4, 3
"""Numbers of objects on the table, of those before the hand, of lamps and of walls."""
SKINS, COVERS = 3, 6
"""Numbers of materials of the robot and of objects."""
CUBE_SIDE, FLAT_SIDE = 64, 256
"""Sides of the textures [px]."""
FLAT = ("table_cover", "floor_cover", "screen", "photograph", *(f"wall_{i}" for i in range(WALLS)))
"""Materials with a flat texture."""
SOLID = tuple(f"skin_{i}" for i in range(SKINS)) + tuple(f"cover_{i}" for i in range(COVERS))
"""Materials with a texture on all sides."""
FAR = (0.0, 0.0, -50.0)
"""Where objects are that a frame has not [m]."""


def make_model() -> mujoco.MjModel:
    """The compiled scene, without the hand's marker."""
    spec = load_spec(asset_path(SCENE))
    hide_marker(spec)
    _add_materials(spec)
    world, box = spec.worldbody, mujoco.mjtGeom.mjGEOM_BOX
    # The model reads a geom's pose anew only if it differs from that of its body: hence `FAR`.
    names = [f"item_{i}" for i in range(ITEMS)] + [f"before_{i}" for i in range(BEFORE)]
    for name in (*names, "screen", "photograph"):
        _add_geom(world, name, box, "screen" if name == "screen" else "cover_0")
    for i in range(WALLS):
        _add_geom(world, f"wall_{i}", mujoco.mjtGeom.mjGEOM_PLANE, f"wall_{i}")
    spec.geom("photograph").material = "photograph"
    for i in range(LAMPS):
        world.add_light(name=f"lamp_{i}", pos=[0.3, 0.0, 1.5], dir=[0.0, 0.0, -1.0])
    return spec.compile()


def hide_marker(spec: mujoco.MjSpec) -> None:
    """Take the hand's marker away."""
    if MARKER in [geom.name for geom in spec.geoms]:
        spec.delete(spec.geom(MARKER))


def _add_geom(world: mujoco.MjsBody, name: str, kind: mujoco.mjtGeom, material: str) -> None:
    world.add_geom(
        name=name, type=kind, size=[0.1, 0.1, 0.1], pos=FAR, quat=[0.8, 0.6, 0.0, 0.0],
        material=material, group=1, contype=0, conaffinity=0,
    )  # fmt: skip


def _add_materials(spec: mujoco.MjSpec) -> None:
    for name in (*FLAT, *SOLID):
        solid = name in SOLID
        side = CUBE_SIDE if solid else FLAT_SIDE
        kind = mujoco.mjtTexture.mjTEXTURE_CUBE if solid else mujoco.mjtTexture.mjTEXTURE_2D
        builtin = mujoco.mjtBuiltin.mjBUILTIN_FLAT
        spec.add_texture(name=name, type=kind, builtin=builtin, width=side, height=side, nchannel=3)
        material = spec.add_material(name=name)
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name


def below(model: mujoco.MjModel, body: int) -> set[int]:
    """A body and all that hang on it."""
    found = {body}
    for other in range(body + 1, model.nbody):  # parents come first
        if int(model.body_parentid[other]) in found:
            found.add(other)
    return found


def hand_geoms(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Which geoms are the hand's (ngeom,)."""
    return geoms_of(model, below(model, model.body(HAND).id))


def robot_geoms(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Which geoms are the robot's (ngeom,)."""
    return geoms_of(model, below(model, model.body("thorax").id))


def geoms_of(model: mujoco.MjModel, bodies: set[int]) -> NDArray[np.bool_]:
    """Which geoms are those of some bodies and visible (ngeom,)."""
    owned = np.isin(model.geom_bodyid, sorted(bodies))
    return np.asarray(owned & (model.geom_group < 3) & (model.geom_rgba[:, 3] > 0.0))


def finger_joints(model: mujoco.MjModel) -> Iterator[int]:
    """Ids of the fingers' joints."""
    hand = model.body(HAND).id
    fingers = below(model, hand) - {hand}
    return (joint for joint in range(model.njnt) if int(model.jnt_bodyid[joint]) in fingers)
