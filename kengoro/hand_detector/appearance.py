"""Random appearances of a scene: colours, textures, lights, walls, objects and what hides the hand.

MuJoCo's scene is a list of geoms that is made from the model for each image. An appearance changes
that list and its lights, so that the model is compiled once. Textures must be in the model:
`add_textures` puts them there.
"""

from __future__ import annotations

import cv2
import mujoco
import numpy as np

from kengoro_env.types import Floats

TEXTURES = 40
"""Number of textures that are added to a model."""
TEXTURE_SIZE = 96
"""Side of a texture [px]."""
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
    """Add random textures, and a material of each, to a specification."""
    for number in range(TEXTURES):
        name = f"{PREFIX}{number}"
        picture = _texture(random)
        spec.add_texture(
            name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, width=TEXTURE_SIZE, height=TEXTURE_SIZE,
            nchannel=3, data=picture.ravel().tolist(),
        )  # fmt: skip
        material = spec.add_material(name=name, texrepeat=[2, 2], texuniform=True)
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name


def _texture(random: np.random.Generator) -> np.ndarray:
    """Noise of a random scale, stripes or squares in two colours (TEXTURE_SIZE, .., 3) uint8."""
    size = TEXTURE_SIZE
    kind = random.integers(3)
    if kind == 0:
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


class Appearance:
    """One appearance: it colours the geoms of a scene, lights it, and adds other objects.

    Args:
        model: that the scene is of, with `add_textures`.
        random: source of its choices.
    """

    def __init__(self, model: mujoco.MjModel, random: np.random.Generator) -> None:
        self._random = random
        names = [model.material(i).name for i in range(model.nmat)]
        self._materials = [i for i, name in enumerate(names) if name.startswith(PREFIX)]
        self._palette = np.clip(
            random.random((5, 1)) ** 0.8 + random.normal(0, random.choice([0.03, 0.3]), (5, 3)),
            0,
            1,
        )
        self._style = random.choice(["model", "palette", "any"], p=[0.3, 0.45, 0.25])
        self._textured = random.choice([0.0, 0.1, 0.5], p=[0.5, 0.3, 0.2])
        self._shine = random.random(3)
        n = model.ngeom
        self._colours = self._palette[random.integers(len(self._palette), size=n)]
        if self._style == "any":
            self._colours = random.random((n, 3))
        self._colours = np.clip(self._colours + random.normal(0, 0.04, (n, 3)), 0.0, 1.0)
        self._covers = np.where(
            random.random(n) < self._textured, random.choice(self._materials, n), -1
        )
        self._tint = random.normal(0.0, 0.06, 3)

    def colour(self, scene: mujoco.MjvScene) -> None:
        """Colour the geoms of the model in a scene."""
        for geom in scene.geoms[: scene.ngeom]:
            if geom.objtype != mujoco.mjtObj.mjOBJ_GEOM or not 0 <= geom.objid < len(self._covers):
                continue
            number = geom.objid
            if self._style == "model":
                geom.rgba[:3] = np.clip(geom.rgba[:3] * (1 + self._tint) + self._tint, 0.0, 1.0)
                continue
            geom.matid = self._covers[number]
            geom.rgba[:3] = self._colours[number] if geom.matid < 0 else 0.5 + 0.5 * self._shine
            geom.specular, geom.shininess = self._shine[:2]
            geom.emission = 0.3 * self._shine[2] ** 3

    def light(self, scene: mujoco.MjvScene) -> None:
        """Light a scene."""
        random = self._random
        ambient, share = random.uniform(0.15, 0.7), random.random()
        warm = 1.0 + random.normal(0.0, 0.08, 3)
        head = scene.lights[0]
        head.ambient[:] = ambient * warm
        head.diffuse[:] = share * random.uniform(0.2, 0.9) * warm
        head.specular[:] = random.uniform(0.0, 0.5)
        scene.nlight = 1
        for light in scene.lights[1 : 1 + random.integers(0, 4)]:
            towards = random.normal(0.0, 1.0, 3)
            towards[2] = -abs(towards[2])
            towards /= np.linalg.norm(towards)
            light.headlight = 0
            light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
            light.castshadow = 0
            light.dir[:], light.pos[:] = towards, -2.0 * towards
            light.attenuation[:] = 1.0, 0.0, 0.0
            light.ambient[:] = 0.0
            light.diffuse[:] = random.uniform(0.1, 0.8) * (1.0 + random.normal(0.0, 0.1, 3))
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
        for _ in range(random.integers(0, 4)):
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
        for _ in range(random.integers(0, 7)):
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
