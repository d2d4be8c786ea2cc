"""Appearances of a laboratory: skins of the robot, surfaces around it, and lights.

`Appearance` writes one into a model. It shares nothing with what a detector is trained on.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from experiments.hand_detector import patterns
from experiments.hand_detector.patterns import Colour, Pattern, Random
from experiments.hand_detector.scene import (
    COVERS as OBJECT_COVERS,
)
from experiments.hand_detector.scene import (
    LAMPS,
    WALLS,
    geoms_of,
    hand_geoms,
    robot_geoms,
)
from jmm_agent.types import Floats

BY_MATERIAL = (0.5, 0.5, 0.5, 1.0)
"""Colour of a geom whose material decides it: MuJoCo's default."""
DIRECTIONAL, CONE = 1, 0
"""MuJoCo's numbers of lights from afar and of lamps with a cone of light."""
NOMINAL = "as in the model"
"""The skin that the model itself has."""


class Surface(NamedTuple):
    """A material of a skin, a table or a floor.

    Attributes:
        pattern: of `patterns`.
        colours: darkest and brightest colour [1].
        specular, shininess: ranges of MuJoCo's numbers [1].
    """

    pattern: Pattern
    colours: tuple[Colour, Colour]
    specular: tuple[float, float] = (0.0, 0.3)
    shininess: tuple[float, float] = (0.1, 0.5)

    def colour(self, rng: Random) -> Floats:
        """A colour of it (3,)."""
        dark, bright = np.array(self.colours)
        shade = rng.uniform()
        return np.clip(dark + (bright - dark) * (0.8 * shade + 0.2 * rng.uniform(size=3)), 0, 1)


SKINS = {
    "aluminium": Surface(
        patterns.brushed, ((0.55, 0.55, 0.56), (0.80, 0.80, 0.82)), (0.4, 1.0), (0.3, 0.9)
    ),
    "black plastic": Surface(
        patterns.plain, ((0.03, 0.03, 0.03), (0.13, 0.13, 0.14)), (0.2, 0.7), (0.2, 0.8)
    ),
    "white shell": Surface(
        patterns.plain, ((0.80, 0.79, 0.76), (0.97, 0.97, 0.97)), (0.2, 0.7), (0.3, 0.9)
    ),
    "orange print": Surface(patterns.layers, ((0.80, 0.28, 0.03), (0.98, 0.50, 0.12))),
    "green print": Surface(patterns.layers, ((0.10, 0.40, 0.12), (0.45, 0.78, 0.25))),
    "carbon": Surface(
        patterns.weave, ((0.05, 0.05, 0.05), (0.13, 0.13, 0.14)), (0.3, 0.9), (0.4, 0.9)
    ),
    "silicone": Surface(patterns.plain, ((0.62, 0.45, 0.36), (0.88, 0.72, 0.60))),
    "blue paint": Surface(
        patterns.scratched, ((0.05, 0.12, 0.35), (0.25, 0.45, 0.80)), (0.2, 0.6), (0.3, 0.8)
    ),
}
"""Skins of robots."""

COVERS = {
    "light wood": Surface(patterns.wood, ((0.60, 0.46, 0.30), (0.85, 0.72, 0.55))),
    "dark wood": Surface(patterns.wood, ((0.20, 0.12, 0.07), (0.42, 0.27, 0.16))),
    "white top": Surface(patterns.plain, ((0.80, 0.80, 0.78), (0.96, 0.96, 0.96)), (0.0, 0.5)),
    "black top": Surface(patterns.rough, ((0.04, 0.04, 0.04), (0.14, 0.14, 0.15))),
    "steel": Surface(patterns.scratched, ((0.45, 0.46, 0.48), (0.68, 0.69, 0.70)), (0.3, 0.8)),
    "cutting mat": Surface(patterns.grid, ((0.05, 0.22, 0.15), (0.25, 0.50, 0.42))),
    "carpet": Surface(patterns.rough, ((0.15, 0.15, 0.20), (0.60, 0.55, 0.55))),
    "papers": Surface(patterns.printed, ((0.70, 0.68, 0.62), (0.95, 0.95, 0.93))),
}
"""Tops of the table."""

GROUNDS = (
    Surface(patterns.rough, ((0.25, 0.25, 0.26), (0.70, 0.70, 0.68))),
    Surface(patterns.grid, ((0.30, 0.30, 0.30), (0.85, 0.84, 0.80)), (0.0, 0.4)),
    Surface(patterns.wood, ((0.30, 0.20, 0.12), (0.75, 0.60, 0.42))),
)

LIGHTS = ("window", "ceiling", "warm lamp", "mixed", "hard lamp", "dim", "overexposed")
"""Kinds of light."""
WARM, NEUTRAL, COOL = (1.0, 0.78, 0.52), (1.0, 0.97, 0.92), (0.82, 0.92, 1.0)
"""Colours of light: a bulb of about 2700 K, tubes of 4500 K, the sky."""


def everyday_colour(rng: Random) -> Floats:
    """Colour (3,) of an object: often grey, white or black, seldom strong."""
    grey, strength = rng.uniform(0.04, 0.95), rng.beta(0.7, 1.6)
    return np.clip(grey + strength * rng.uniform(-0.5, 0.5, 3), 0.02, 1.0)


class Appearance:
    """Writes appearances into a model.

    Args:
        model: of `scene.make_model`, as it was compiled.

    Attributes:
        changed: textures that were written since they were uploaded.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._rgba, self._matid = model.geom_rgba.copy(), model.geom_matid.copy()
        self._hand, self._robot = hand_geoms(model), robot_geoms(model)
        palm = {model.body("hand").id}
        self._fingers = self._hand & ~geoms_of(model, palm)
        self._outside = np.array([model.geom(i).name in ("table_top", "floor") for i in
                                  range(model.ngeom)])  # fmt: skip
        self.changed: set[int] = set()

    def write(self, rng: Random) -> dict[str, str]:
        """Write an appearance.

        Returns:
            Its families: skin of the hand, top of the table, and light.
        """
        self._model.geom_rgba[:], self._model.geom_matid[:] = self._rgba, self._matid
        skin = self._write_robot(rng)
        table = str(rng.choice(list(COVERS)))
        self._cover("table_top", "table_cover", COVERS[table], rng)
        self._cover("floor", "floor_cover", GROUNDS[rng.integers(len(GROUNDS))], rng)
        self._write_room(rng)
        for i in range(OBJECT_COVERS):
            pattern = (patterns.plain, patterns.printed, patterns.scratched)[i % 3]
            surface = Surface(pattern, ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), (0.0, 0.8))
            self.paint(f"cover_{i}", surface, rng, everyday_colour(rng))
        return {"skin": skin, "table": table, "light": self._write_lights(rng)}

    def paint(
        self, material: str, surface: Surface, rng: Random, colour: Floats | None = None
    ) -> None:
        """Write a surface into a material.

        Args:
            material: its name, also that of its texture.
            surface: the surface.
            rng: chooses colour and pattern.
            colour: (3,) [1]; one of the surface's by default.
        """
        model, texture = self._model, self._model.texture(material)
        side, rows = int(texture.width[0]), int(texture.height[0])
        colour = surface.colour(rng) if colour is None else colour
        image = surface.pattern(rng, side, colour)
        self.print(material, np.concatenate([image] * (rows // side)))
        number = model.material(material).id
        model.mat_rgba[number] = 1.0
        model.mat_specular[number] = rng.uniform(*surface.specular)
        model.mat_shininess[number] = rng.uniform(*surface.shininess)
        model.mat_emission[number] = model.mat_reflectance[number] = 0.0

    def print(self, texture: str, image: Floats) -> None:
        """Write an image (height, width, 3) from 0 to 1 into a texture."""
        number = self._model.texture(texture).id
        first = int(self._model.tex_adr[number])
        values = np.rint(255.0 * np.clip(image, 0.0, 1.0)).astype(np.uint8).ravel()
        self._model.tex_data[first : first + len(values)] = values
        self.changed.add(number)

    def _cover(self, geom: str, material: str, surface: Surface, rng: Random) -> None:
        self.paint(material, surface, rng)
        number = self._model.geom(geom).id
        self._model.geom_matid[number] = self._model.material(material).id
        self._model.geom_rgba[number] = BY_MATERIAL

    def _write_robot(self, rng: Random) -> str:
        """Skins of palm, fingers and the other parts; the name of the palm's."""
        names = [NOMINAL, *SKINS]
        palm = str(rng.choice(names))
        fingers = palm if rng.uniform() < 0.5 else str(rng.choice(names))
        others = palm if rng.uniform() < 0.5 else str(rng.choice(names))
        parts = (
            (self._hand & ~self._fingers, palm),
            (self._fingers, fingers),
            (self._robot & ~self._hand, others),
        )
        for number, (geoms, name) in enumerate(parts):
            surface = SKINS.get(name, SKINS["aluminium"])
            self.paint(f"skin_{number}", surface, rng)
            if name == NOMINAL:
                continue
            self._model.geom_matid[geoms] = self._model.material(f"skin_{number}").id
            self._model.geom_rgba[geoms] = BY_MATERIAL
        return palm

    def _write_room(self, rng: Random) -> None:
        """Walls, what stands before them, and the colour of what is beyond."""
        model = self._model
        distances = rng.uniform((0.9, 0.7, 0.7), (2.8, 2.5, 2.5))
        poses = (
            ((distances[0], 0.0, 0.0), (0.5, -0.5, 0.5, -0.5)),
            ((0.0, distances[1], 0.0), (0.7071, 0.7071, 0.0, 0.0)),
            ((0.0, -distances[2], 0.0), (0.7071, -0.7071, 0.0, 0.0)),
        )
        surface = Surface(patterns.room, ((0.35, 0.35, 0.35), (0.95, 0.95, 0.93)))
        for i, (position, turn) in zip(range(WALLS), poses, strict=True):
            self.paint(f"wall_{i}", surface, rng, 0.3 + 0.65 * everyday_colour(rng))
            wall = model.geom(f"wall_{i}")
            wall.pos[:], wall.quat[:], wall.size[:] = position, turn, (3.0, 1.4, 1.0)
        sky = model.texture("sky").id
        first = int(model.tex_adr[sky])
        count = int(model.tex_width[sky] * model.tex_height[sky])
        model.tex_data[first : first + 3 * count] = np.tile(
            (255.0 * everyday_colour(rng)).astype(np.uint8), count
        )
        self.changed.add(sky)
        self.paint("screen", Surface(patterns.screen, ((0.05, 0.1, 0.2), (0.3, 0.5, 0.8))), rng)
        model.mat_emission[model.material("screen").id] = rng.uniform(0.3, 1.0)

    def _write_lights(self, rng: Random) -> str:
        """Lamps and the light from all sides; the kind of light."""
        model, kind = self._model, str(rng.choice(LIGHTS))
        like = kind if kind not in ("dim", "overexposed") else str(rng.choice(LIGHTS[:5]))
        ambient, lamps = _lamps(rng, like)
        for i in range(model.nlight):
            model.light_active[i] = False
        for i, lamp in zip(range(LAMPS), lamps, strict=False):
            number = model.light(f"lamp_{i}").id
            model.light_active[number] = True
            model.light_type[number] = int(lamp.kind)
            model.light_pos[number] = lamp.position
            model.light_dir[number] = -lamp.position / np.linalg.norm(lamp.position)
            model.light_diffuse[number] = lamp.colour
            model.light_specular[number] = 0.5 * lamp.colour
            model.light_castshadow[number] = lamp.shadow
            model.light_cutoff[number], model.light_exponent[number] = lamp.cone
        model.vis.headlight.ambient[:] = ambient
        model.vis.headlight.diffuse[:] = rng.uniform(0.0, 0.2)
        model.vis.headlight.specular[:] = 0.0
        return kind


class _Lamp(NamedTuple):
    kind: mujoco.mjtLightType
    position: Floats
    colour: Floats
    shadow: bool
    cone: tuple[float, float] = (80.0, 1.0)


def _lamps(rng: Random, kind: str) -> tuple[Floats, list[_Lamp]]:
    """The light from all sides (3,), and the lamps of a kind of light."""
    far, near = mujoco.mjtLightType(DIRECTIONAL), mujoco.mjtLightType(CONE)

    def lamp(light: mujoco.mjtLightType, colour: Colour, power: float, low: float) -> _Lamp:
        around, height = rng.uniform(-np.pi, np.pi), rng.uniform(low, low + 0.8)
        distance = rng.uniform(0.6, 1.6)
        position = np.array([distance * np.cos(around), distance * np.sin(around), height])
        tinted = power * np.array(colour) * rng.uniform(0.92, 1.08, 3)
        cone = (float(rng.uniform(40.0, 80.0)), float(rng.uniform(0.0, 8.0)))
        return _Lamp(light, position, tinted, True, cone)

    if kind == "window":
        return rng.uniform(0.25, 0.5) * np.array(COOL), [lamp(far, COOL, 0.9, 0.3)]
    if kind == "ceiling":
        tubes = [lamp(far, NEUTRAL, rng.uniform(0.25, 0.5), 1.4) for _ in range(3)]
        return rng.uniform(0.3, 0.6) * np.array(NEUTRAL), tubes
    if kind == "warm lamp":
        bulb = lamp(near, WARM, 1.0, 0.5)
        return rng.uniform(0.15, 0.35) * np.array(WARM), [bulb, lamp(far, WARM, 0.2, 1.0)]
    if kind == "mixed":
        both = [lamp(near, WARM, 0.8, 0.5), lamp(far, COOL, 0.7, 0.3)]
        return rng.uniform(0.2, 0.4) * np.array(NEUTRAL), both
    hard = lamp(near, NEUTRAL, 1.3, 0.2)
    return rng.uniform(0.08, 0.16) * np.array(NEUTRAL), [hard]
