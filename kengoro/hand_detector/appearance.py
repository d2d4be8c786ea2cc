"""Random appearances of a scene: colours, textures, lights, walls, objects and what hides the hand.

MuJoCo's scene is a list of geoms that is made from the model for each image. An appearance changes
that list and its lights, so that the model is compiled once. Textures must be in the model:
`add_textures` puts them there.
"""

from __future__ import annotations

import cv2
import mujoco
import numpy as np

from kengoro_env.robot.subtree import subtree
from kengoro_env.types import Floats

TEXTURES = 40
"""Number of textures that are added to a model."""
TEXTURE_SIZE = 96
"""Side of a texture [px]."""
SHADOWS = 0.4
"""Share of the frames in which a light casts shadows [1]."""
CONE = mujoco.mjtLightType(0)
"""Type of a light with a cone, the first of MuJoCo's."""
ROBOT_PARTS = 3
"""Palm, fingers and the other bodies of a robot may be of different surfaces."""
PREFIX = "appearance_"
"""Names of the added textures and materials begin with this."""
SHAPES = (
    mujoco.mjtGeom.mjGEOM_BOX,
    mujoco.mjtGeom.mjGEOM_SPHERE,
    mujoco.mjtGeom.mjGEOM_CAPSULE,
    mujoco.mjtGeom.mjGEOM_CYLINDER,
    mujoco.mjtGeom.mjGEOM_ELLIPSOID,
)


def add_textures(spec: mujoco.MjSpec, random: np.random.Generator) -> None:
    """Add random textures, and a material of each, to a specification.

    Every fourth is around a body (a cube), the others are flat.
    """
    for number in range(TEXTURES):
        name = f"{PREFIX}{number}"
        picture = _texture(random)
        around = number % 4 == 3
        kind = mujoco.mjtTexture.mjTEXTURE_CUBE if around else mujoco.mjtTexture.mjTEXTURE_2D
        spec.add_texture(
            name=name, type=kind, width=TEXTURE_SIZE, height=TEXTURE_SIZE * (6 if around else 1),
            nchannel=3, data=np.tile(picture.ravel(), 6 if around else 1).tolist(),
        )  # fmt: skip
        material = spec.add_material(name=name, texrepeat=[2, 2], texuniform=True)
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name


def _texture(random: np.random.Generator) -> np.ndarray:
    """Noise, stripes, squares or bars in two colours (TEXTURE_SIZE, .., 3) uint8."""
    size = TEXTURE_SIZE
    kind = random.integers(4)
    if kind == 3:
        share = _bars(random)
    elif kind == 0:
        cells = int(random.integers(2, 32))
        coarse = random.random((cells, cells, 3)).astype(np.float32)
        if random.random() < 0.5:
            coarse[:] = coarse[..., :1]
        mode = cv2.INTER_CUBIC if random.random() < 0.7 else cv2.INTER_NEAREST
        share = np.clip(cv2.resize(coarse, (size, size), interpolation=mode), 0.0, 1.0)
    else:
        y, x = np.mgrid[:size, :size] / size * 2.0 * np.pi
        turns = random.integers(1, 8, 2)
        wave = np.sin(turns[0] * x) * (np.sin(turns[1] * y) if kind == 2 else 1.0)
        if random.random() < 0.5:
            wave = np.sign(wave)
        share = (0.5 + 0.5 * wave)[..., None]
    first, second = random.random((2, 3))
    if random.random() < 0.5:
        second = np.clip(first + random.normal(0.0, 0.15, 3), 0.0, 1.0)
    return (255.0 * (first + (second - first) * share)).astype(np.uint8)


def _bars(random: np.random.Generator) -> np.ndarray:
    """Bars of random lengths in lines, as in print (TEXTURE_SIZE, TEXTURE_SIZE, 1)."""
    share = np.zeros((TEXTURE_SIZE, TEXTURE_SIZE, 1))
    row = 0
    while row < TEXTURE_SIZE:
        height = int(random.integers(2, 12))
        column = int(random.integers(0, 12))
        while column < TEXTURE_SIZE:
            width = int(random.integers(2, 30))
            share[row : row + height, column : column + width] = random.uniform(0.3, 1.0)
            column += width + int(random.integers(1, 8))
        row += height + int(random.integers(1, 8))
    return share


class Appearance:
    """One appearance: it colours the geoms of a scene, lights it, and adds other objects.

    Args:
        model: that the scene is of, with `add_textures`.
        parts: part of the robot that each geom belongs to, see `robot_parts`.
        random: source of its choices.
    """

    def __init__(
        self, model: mujoco.MjModel, parts: np.ndarray, random: np.random.Generator
    ) -> None:
        self._random = random
        names = [model.material(i).name for i in range(model.nmat)]
        self._materials = [i for i, name in enumerate(names) if name.startswith(PREFIX)]
        self._style = random.choice(["model", "parts", "palette", "any"], p=[0.2, 0.5, 0.2, 0.1])
        self._parts = parts
        n = model.ngeom
        self._colours, self._covers = np.zeros((n, 3)), np.full(n, -1)
        self._shine = random.random((n, 3))
        if self._style in ("parts", "model"):
            self._colour_parts()
        else:
            self._colour_each(n)
        self._tint = random.normal(0.0, 0.06, 3)

    def _colour_parts(self) -> None:
        """One surface for each part of the robot, and one for each other geom."""
        random = self._random
        same = random.random() < 0.5
        first: tuple[Floats, int, Floats] | None = None
        for number in range(self._parts.max() + 1):
            geoms = np.flatnonzero(self._parts == number)
            surface = (_colour(random), self._cover(0.35), random.random(3))
            first = first or surface
            if same and number < ROBOT_PARTS:
                surface = first
            spread = random.choice([0.0, 0.02, 0.08])
            self._colours[geoms] = surface[0] + random.normal(0.0, spread, (len(geoms), 3))
            self._covers[geoms], self._shine[geoms] = surface[1], surface[2]
        for geom in np.flatnonzero(self._parts < 0):
            self._colours[geom], self._covers[geom] = _colour(random), self._cover(0.6)
        self._colours = np.clip(self._colours, 0.0, 1.0)

    def _colour_each(self, n: int) -> None:
        """A colour for each geom, of a few or of all."""
        random = self._random
        palette = random.random((5, 1)) ** 0.8
        palette = palette + random.normal(0, random.choice([0.03, 0.3]), (5, 3))
        colours = palette[random.integers(len(palette), size=n)]
        if self._style == "any":
            colours = random.random((n, 3))
        self._colours = np.clip(colours + random.normal(0, 0.04, (n, 3)), 0.0, 1.0)
        textured = random.choice([0.0, 0.1, 0.5], p=[0.5, 0.3, 0.2])
        self._covers = np.where(random.random(n) < textured, random.choice(self._materials, n), -1)
        self._shine[:] = random.random(3)

    def _cover(self, share: float) -> int:
        """Number of a material with a texture, or -1."""
        random = self._random
        return int(random.choice(self._materials)) if random.random() < share else -1

    def colour(self, scene: mujoco.MjvScene) -> None:
        """Colour the geoms of the model in a scene."""
        for geom in scene.geoms[: scene.ngeom]:
            if geom.objtype != mujoco.mjtObj.mjOBJ_GEOM or not 0 <= geom.objid < len(self._covers):
                continue
            number = geom.objid
            if self._style == "model" and (self._parts[number] >= 0 or self._shine[0, 0] < 0.4):
                geom.rgba[:3] = np.clip(geom.rgba[:3] * (1 + self._tint) + self._tint, 0.0, 1.0)
                continue
            geom.matid = self._covers[number]
            shine = self._shine[number]
            geom.rgba[:3] = self._colours[number]
            if geom.matid >= 0:
                geom.rgba[:3] = 0.5 + 0.5 * geom.rgba[:3]
            geom.specular, geom.shininess = shine[:2]
            geom.emission = 0.3 * shine[2] ** 3

    def light(self, scene: mujoco.MjvScene, hand: Floats) -> None:
        """Light a scene.

        Args:
            scene: that is lit.
            hand: position of the hand (3,) [m], near which lamps shine.
        """
        random = self._random
        ambient, share = random.uniform(0.08, 0.7), random.random()
        warm = 1.0 + random.normal(0.0, 0.08, 3)
        head = scene.lights[0]
        head.ambient[:] = ambient * warm
        head.diffuse[:] = share * random.uniform(0.0, 0.9) * warm
        head.specular[:] = random.uniform(0.0, 0.5)
        scene.nlight = 1
        shadow = bool(random.random() < SHADOWS)
        scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadow
        for number, light in enumerate(scene.lights[1 : 1 + random.integers(0, 4)]):
            towards = random.normal(0.0, 1.0, 3)
            towards[2] = -abs(towards[2])
            towards /= np.linalg.norm(towards)
            near = random.random() < 0.4
            aim = hand + random.normal(0.0, 0.25, 3)
            light.headlight, light.id = 0, -1
            light.type = CONE if near else mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
            light.castshadow = shadow and number == 0
            light.dir[:] = towards
            light.pos[:] = aim - random.uniform(0.5, 1.6) * towards
            light.cutoff, light.exponent = random.uniform(25.0, 80.0), random.uniform(0.0, 8.0)
            light.attenuation[:] = 1.0, 0.0, 0.0
            light.ambient[:] = 0.0
            light.diffuse[:] = random.uniform(0.1, 1.2) * (1.0 + random.normal(0.0, 0.12, 3))
            light.specular[:] = random.uniform(0.0, 0.6)
            scene.nlight += 1

    def add_walls(self, scene: mujoco.MjvScene, camera: Floats, forward: Floats) -> None:
        """Add walls behind what the camera sees.

        Args:
            scene: to which they are added.
            camera: position of the camera (3,) [m].
            forward: its direction (3,).
        """
        random = self._random
        for _ in range(random.integers(0, 5)):
            towards = forward + random.normal(0.0, 0.35, 3)
            towards /= np.linalg.norm(towards)
            at = camera + random.uniform(1.0, 3.0) * towards
            size = np.array([*random.uniform(0.3, 3.0, 2), 0.01])
            self._add(scene, mujoco.mjtGeom.mjGEOM_BOX, size, at, _facing(-towards, random))

    def add_objects(self, scene: mujoco.MjvScene, camera: Floats, hand: Floats) -> None:
        """Add objects around the hand, and sometimes one that hides a part of it.

        Args:
            scene: to which they are added.
            camera: position of the camera (3,) [m].
            hand: position of the hand (3,) [m].
        """
        random = self._random
        for _ in range(random.integers(0, 12)):
            at = hand + random.normal(0.0, 0.25, 3)
            away = hand - camera
            if (at - camera) @ away < 1.05 * away @ away:  # not before the hand
                at += (1.05 - (at - camera) @ away / (away @ away)) * away
            size = random.uniform(0.01, 0.08, 3)
            self._add(scene, random.choice(SHAPES), size, at, _rotation(random))
        if random.random() < 0.35:
            away = hand - camera
            at = camera + random.uniform(0.55, 0.93) * away
            aside = np.cross(away, random.normal(0.0, 1.0, 3))
            at += random.uniform(0.02, 0.09) * aside / np.linalg.norm(aside)
            size = random.uniform(0.006, 0.035, 3)
            self._add(scene, random.choice(SHAPES), size, at, _rotation(random))

    def _add(
        self, scene: mujoco.MjvScene, shape: int, size: Floats, at: Floats, rotation: Floats
    ) -> None:
        random = self._random
        if scene.ngeom >= scene.maxgeom:
            return
        geom = scene.geoms[scene.ngeom]
        rgba = np.array([*random.random(3), 1.0], dtype=np.float32)
        mujoco.mjv_initGeom(geom, int(shape), size, at, rotation.ravel(), rgba)
        geom.objtype, geom.objid = int(mujoco.mjtObj.mjOBJ_UNKNOWN), -1
        if random.random() < 0.5:
            geom.matid = int(random.choice(self._materials))
            geom.rgba[:3] = random.uniform(0.5, 1.0)
        scene.ngeom += 1


def robot_parts(model: mujoco.MjModel, hand: int) -> np.ndarray:
    """Part of the robot that each geom belongs to (ngeom,): 0 palm, 1 fingers, 2 others; or -1.

    Args:
        model: of the robot in its surroundings.
        hand: number of the hand's body.
    """
    own = subtree(model, hand)[model.geom_bodyid]
    tree = model.body_rootid == model.body_rootid[hand]
    parts = np.where(tree[model.geom_bodyid], 2, -1)
    parts[own] = 1
    parts[model.geom_bodyid == hand] = 0
    return parts


def _colour(random: np.random.Generator) -> Floats:
    """Colour (3,) of a surface: grey, somewhat coloured, or strongly."""
    grey = random.random()
    return np.clip(grey + random.normal(0.0, random.choice([0.02, 0.12, 0.4]), 3), 0.0, 1.0)


def _rotation(random: np.random.Generator) -> Floats:
    matrix = np.zeros(9)
    quaternion = random.normal(0.0, 1.0, 4)
    mujoco.mju_quat2Mat(matrix, quaternion / np.linalg.norm(quaternion))
    return matrix.reshape(3, 3)


def _facing(normal: Floats, random: np.random.Generator) -> Floats:
    """A rotation (3, 3) whose z axis is a normal."""
    side = np.cross(normal, random.normal(0.0, 1.0, 3))
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(normal, side), normal], axis=1)
