"""Which geoms of a scene are rendered, and which are left out."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from kengoro_env.stepping.c_compiler import library
from kengoro_env.vision.quick_renderer import QuickRenderer
from kengoro_env.vision.rendering import Painter
from tests.kengoro_env.vision.frames import BALL, DOWN, WIDE, assert_same, painted, slow_painter

pytestmark = pytest.mark.skipif(library() is None, reason="there is no compiled code here")


@pytest.fixture
def rendered(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, bool]]:
    """Number of geoms without a piece of floor, and whether the sky is rendered, of each image."""
    noted = list[tuple[int, bool]]()
    draw = mujoco.mjr_render

    def noting(where: mujoco.MjrRect, scene: mujoco.MjvScene, context: Any) -> None:
        kinds = [(geom.type, geom.dataid) for geom in scene.geoms[: scene.ngeom]]
        nothing, piece = mujoco.mjtGeom.mjGEOM_NONE, (mujoco.mjtGeom.mjGEOM_PLANE, -1)
        geoms = sum(kind[0] != nothing and kind != piece for kind in kinds)
        noted.append((geoms, bool(scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX])))
        draw(where, scene, context)

    monkeypatch.setattr(mujoco, "mjr_render", noting)
    return noted


FLAT = '<texture type="skybox" builtin="flat" rgb1="0 0 1" rgb2="0 0 1" width="8" height="8"/>'
GRADED = '<texture type="skybox" builtin="gradient" rgb1="0 0 1" width="8" height="8"/>'
CHECKED = (
    FLAT + '<texture name="t" type="2d" builtin="checker" rgb1="1 0 0" width="8" height="8"/>'
    '<material name="checked" texture="t" texrepeat="9 9"/>'
)
LENS = 'pos="0 0 1" resolution="640 480" sensorsize="0.008 0.002" focal="0.002 0.001"'
NARROW = '<geom type="plane" size="1.2 1.2 1"/>'  # the picture is 2 m high and 2.7 m wide there
BESIDE = '<geom size="0.1" pos="{} {} 0.5"/>'
CORNER = '<geom size="0.01" pos="{} {} 0.5"/>'
POSITIONS = [((2 * i - 7) / 12, (2 * j - 5) / 12) for j in range(6) for i in range(8)]
LOW_LEFT, ALL_BUT_LAST = POSITIONS[0], POSITIONS[:-1]
BAR = '<mesh name="bar" vertex="{0} 0 {1} {0} 0.1 {1} {0} 0 2 0.9 0 {1}"/>'
AROUND = '<geom type="ellipsoid" size="{}" pos="{}"/>'


@pytest.mark.parametrize(
    ("assets", "world", "camera", "geoms", "sky"),
    [
        # A floor that fills the picture, below all else, is not rendered, and hides the sky.
        (FLAT, WIDE, DOWN, 0, False),
        (FLAT, WIDE + BALL.format(0.3, 1), DOWN, 1, False),
        (GRADED, WIDE + BALL.format(0.3, 1), DOWN, 1, False),
        (FLAT, WIDE, LENS, 0, False),
        (FLAT, '<geom type="plane" size="90 90 1" pos="0 0 -14"/>', DOWN, 0, False),
        # It is rendered where something is below it, or shines through, or has not one colour.
        (FLAT, WIDE + BALL.format(0.05, 1), DOWN, 2, False),
        (FLAT, WIDE + BALL.format(-0.3, 1), DOWN, 2, False),
        (FLAT, WIDE + '<geom type="capsule" size="0.1 0.3" pos="0 0 0.35"/>', DOWN, 2, False),
        (FLAT, WIDE + BALL.format(0.3, 0.5), DOWN, 2, False),
        (CHECKED, '<geom type="plane" size="3 3 1" material="checked"/>', DOWN, 1, False),
        (FLAT, WIDE + '<light pos="1 0 3" cutoff="80" exponent="1"/>', DOWN, 1, False),
        (FLAT, WIDE + '<light pos="1 0 3" dir="1 0 -3" type="directional"/>', DOWN, 1, False),
        (FLAT, BALL.format(0.3, 1) + WIDE, DOWN, 2, False),
        (FLAT, WIDE + WIDE, DOWN, 2, False),
        (FLAT, WIDE + '<light pos="0 0 2" specular="0 0 0" type="point"/>', DOWN, 1, False),
        # Highlights of a light do not matter for a plane without highlights.
        (
            '<material name="dull" specular="0"/>',
            '<geom type="plane" size="3 3 1" material="dull"/>'
            '<light pos="1 0 3" dir="1 0 -3" type="directional"/>',
            *(DOWN, 0, False),
        ),
        # Its colour is read where nothing else is: at the second of 8 x 6 places, the last, none.
        (FLAT, WIDE + CORNER.format(*LOW_LEFT), DOWN, 1, False),
        (FLAT, WIDE + BESIDE.format(LOW_LEFT[0] + 0.125, LOW_LEFT[1]), DOWN, 1, False),
        (FLAT, WIDE + "".join(CORNER.format(*at) for at in ALL_BUT_LAST), DOWN, 47, False),
        (FLAT, WIDE + '<geom type="box" size="1 1 0.01" pos="0 0 0.4"/>', DOWN, 2, False),
        # A sky of one colour is not rendered.
        (FLAT, NARROW, DOWN, 1, False),
        ("", NARROW, DOWN, 1, False),
        (FLAT, BALL.format(0.3, 1), DOWN, 1, False),
        # It is rendered where it has more than one (rgb2 is below), or something shines through.
        (GRADED, NARROW, DOWN, 1, True),
        (GRADED, WIDE, DOWN + ' euler="70 0 0"', 1, True),
        (FLAT, NARROW + BALL.format(0.3, 0.5), DOWN, 2, True),
        (GRADED, '<geom type="plane" size="3 3 1" rgba="1 1 1 0.5"/>', DOWN, 1, True),
        # Planes that do not fill the picture.
        (GRADED, '<geom type="plane" size="3 3 1" pos="0 0 2"/>', DOWN, 1, True),
        (GRADED, '<geom type="plane" size="3 3 1" pos="2 0 0"/>', DOWN, 1, True),
        (GRADED, '<geom type="plane" size="1.2 1.2 9"/>', DOWN, 1, True),
        (GRADED, WIDE, 'pos="0 0 1" fovy="0.01" projection="orthographic"', 1, True),
        (GRADED, '<geom type="plane" size="1.5 1.5 1"/>', LENS, 1, True),  # it sees 4 m of it
        (
            GRADED,
            '<geom type="plane" size="90 90 1" pos="0 0 -20"/>',
            DOWN,
            1,
            True,
        ),  # behind the sky
        (GRADED, '<geom type="plane" size="0 0 1"/>', DOWN, 1, True),  # endless, with haze
        # What is beside the picture.
        (FLAT, WIDE + '<geom size="0.1" pos="3 0 0.3"/>', DOWN, 0, False),
        (FLAT, WIDE + '<geom size="0.1" pos="0 -3 0.3"/>', DOWN, 0, False),
        (FLAT, WIDE + '<geom size="0.1" pos="0 0 1.3"/>', DOWN, 0, False),
        # A mesh of which a sphere holds the camera: beside the picture, and in its corner.
        (FLAT + BAR.format(0.5, 0.8), WIDE + '<geom type="mesh" mesh="bar"/>', DOWN, 0, False),
        (FLAT + BAR.format(0.5, 0.5), WIDE + '<geom type="mesh" mesh="bar"/>', DOWN, 2, False),
        # What is around the camera, near and not so near its middle.
        (FLAT, WIDE + '<geom size="0.1" pos="0 0 1.06"/>', DOWN, 0, False),
        (FLAT, WIDE + '<geom size="0.1" pos="0 0 1.08"/>', DOWN, 2, False),
        (FLAT, WIDE + AROUND.format("0.1 0.2 0.3", "0.05 0.05 1"), DOWN, 0, False),
        (FLAT, WIDE + BALL.format(1, 0.5).replace("0.1 0.2", "0 0"), DOWN, 0, False),
        (FLAT, WIDE + AROUND.format("0.1 0.2 0.3", "0.09 0.05 1"), DOWN, 2, False),
    ],
)
def test_only_visible_geoms_are_rendered(
    assets: str, world: str, camera: str, geoms: int, sky: bool, rendered: list[tuple[int, bool]]
) -> None:
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><statistic extent='1'/><visual><headlight specular='0 0 0'/></visual>"
        f"<asset>{assets}</asset>"
        f"<worldbody>{world}<camera name='eye' {camera}/></worldbody></mujoco>"
    )
    painter, data = Painter(model), mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for _ in range(2):
        painter.draw(data, "eye")  # the first picture is rendered in full, too
    assert isinstance(painter._renderer, QuickRenderer)
    assert not painter._renderer._differs
    painter.close()
    assert rendered[-1] == (geoms, sky)
    assert_same(model)


def test_a_tendon_outside_of_the_image_is_not_rendered(rendered: list[tuple[int, bool]]) -> None:
    hidden = 'group="4"'
    sites = "".join(f'<site name="{i}" pos="{2 * i - 2} 0 0.5" {hidden}/>' for i in range(6))
    tendon = "".join(f'<site site="{i}"/>' for i in range(6))
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{sites}<camera name='eye' {DOWN}/></worldbody>"
        f"<tendon><spatial name='tendon'>{tendon}</spatial></tendon></mujoco>"
    )
    painted(model, "eye")
    assert rendered[-2] == (2, False)  # of five parts, those that begin or end in the middle
    assert_same(model)


def test_added_geoms_are_not_hidden_by_the_background(
    rendered: list[tuple[int, bool]],
) -> None:
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{WIDE}<camera name='eye' {DOWN}/></worldbody></mujoco>"
    )
    data, painter, full = mujoco.MjData(model), Painter(model), slow_painter(model)
    mujoco.mj_forward(model, data)

    def decorate(scene: mujoco.MjvScene) -> None:
        scene.ngeom += 1
        mujoco.mjv_initGeom(
            scene.geoms[scene.ngeom - 1],
            *(mujoco.mjtGeom.mjGEOM_SPHERE, np.full(3, 0.2), np.zeros(3), np.eye(3).ravel()),
            np.array([1.0, 0.0, 0.0, 0.5], dtype=np.float32),
        )

    for decoration in (None, None, decorate):
        pictures = [each.draw(data, "eye", decoration) for each in (painter, full)]
        assert np.array_equal(*pictures)
    assert rendered[-2] == (2, False)
    for each in (painter, full):
        each.close()


FLEX = (
    '<flexcomp name="cloth" type="grid" count="3 3 1" spacing="0.1 0.1 0.1" dim="2" rigid="true"/>'
)


def test_no_background_is_filled_in_for_skins_flexes_and_alpha(
    rendered: list[tuple[int, bool]],
) -> None:
    cloth, glass = (
        mujoco.MjSpec.from_string(
            f"<mujoco><worldbody>{WIDE}{more}<camera name='eye' {DOWN}/></worldbody></mujoco>"
        )
        for more in (FLEX, "")
    )
    texture = glass.add_texture(name="glass", type=mujoco.mjtTexture.mjTEXTURE_2D)
    texture.width, texture.height, texture.nchannel, texture.data = 2, 2, 4, bytes(16)
    for model in (cloth.compile(), glass.compile()):
        rendered.clear()
        painter, data = Painter(model), mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        for _ in range(2):
            painter.draw(data, "eye")
        painter.close()
        assert len(rendered) == 4  # two by two renderers at the opening, and each picture once
