"""Pictures from which is left out what nobody sees are, pixel by pixel, those of all there is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest

from kengoro_env import quick_renderer, rendering
from kengoro_env.assets import asset_path
from kengoro_env.compiling import library
from kengoro_env.departures import WireStretch
from kengoro_env.quick_renderer import QuickRenderer
from kengoro_env.rendering import HEIGHT, WIDTH, Painter
from kengoro_env.robot import Robot
from tests.kengoro_env.painting import painted

pytestmark = pytest.mark.skipif(library() is None, reason="there is no compiled code here")


def slow_painter(model: mujoco.MjModel, width: int = WIDTH, height: int = HEIGHT) -> Painter:
    """A painter that draws all there is; it has drawn once."""
    painter, data = Painter(model, width, height), mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rendering, "library", lambda: None)
        painter.draw(data, model.camera(0).name)
    assert type(painter._renderer) is mujoco.Renderer
    return painter


@pytest.mark.parametrize("stretches", [False, True])
@pytest.mark.parametrize("scene", ["posture", "can_grasp", "elbow"])
def test_a_robot_looks_the_same(scene: str, stretches: bool) -> None:
    departures = (WireStretch(1e-5),) if stretches else ()
    model = Robot(asset_path(f"mjcf/kengoro_arm/{scene}.xml"), departures).model
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    limited = model.jnt_limited.astype(bool)
    low, high = model.jnt_range[limited].T
    quick, slow = Painter(model), slow_painter(model)
    for _ in range(12):
        data.qpos[model.jnt_qposadr[limited]] = rng.uniform(low, high)
        mujoco.mj_forward(model, data)
        for camera in (model.camera(i).name for i in range(model.ncam)):
            assert np.array_equal(quick.draw(data, camera), slow.draw(data, camera))
    assert type(quick._renderer) is QuickRenderer
    for painter in (quick, slow):
        painter.close()


KINDS = [
    getattr(mujoco.mjtGeom, f"mjGEOM_{name}")
    for name in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX", "MESH", "PLANE")
]
LENSES: list[dict[str, Any]] = [
    {"fovy": 70},
    {"fovy": 15},
    {
        "resolution": [640, 480],
        "sensor_size": [0.008, 0.006],
        "focal_length": [0.012, 0.005],
        "principal_length": [0.001, -0.001],
    },
    {"fovy": 2, "proj": mujoco.mjtProjection.mjPROJ_ORTHOGRAPHIC},
]


def scattered(rng: np.random.Generator, lens: dict[str, Any]) -> mujoco.MjSpec:
    """Things of all kinds around a camera that looks down to a floor, some of them below it."""
    spec = mujoco.MjSpec()
    spec.stat.extent = 2.0
    spec.visual.headlight.specular = [0, 0, 0]
    spec.add_texture(
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        rgb1=[0.1, 0.4, 0.9],
        width=4,
        height=4,
    )
    spec.add_mesh(name="wedge", uservert=[0, 0, 0, 0.3, 0, 0, 0, 0.4, 0, 0, 0, 0.8])
    world = spec.worldbody
    world.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[20, 20, 1], rgba=[0.5, 0.4, 0.3, 1])
    for i in range(12):
        kind = KINDS[rng.integers(len(KINDS))]
        world.add_geom(
            type=kind,
            meshname="wedge" if kind == mujoco.mjtGeom.mjGEOM_MESH else "",
            size=rng.uniform(0.02, 0.3, 3),
            pos=rng.uniform([-1.5, -1.5, 0.1], [1.5, 1.5, 2.5]),
            quat=rng.normal(size=4),
            rgba=[*rng.uniform(0.2, 1.0, 3), rng.choice([1.0, 1.0, 1.0, 0.4]) if i == 0 else 1.0],
        )
    tilt = rng.uniform(0.0, 1.2)
    world.add_camera(
        name="eye", pos=[0, 0, 1.3], quat=[np.cos(tilt / 2), np.sin(tilt / 2), 0, 0], **lens
    )
    return spec


@pytest.mark.parametrize("lens", LENSES, ids=["wide", "narrow", "shifted", "orthographic"])
def test_things_look_the_same_wherever_they_are(lens: dict[str, Any]) -> None:
    rng = np.random.default_rng(0)
    for i in range(10):
        assert_same(scattered(rng, lens).compile(), *((131, 90) if i % 2 else (WIDTH, HEIGHT)))


def assert_same(model: mujoco.MjModel, width: int = WIDTH, height: int = HEIGHT) -> None:
    """A model's camera called eye sees the same when all is drawn."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    full = slow_painter(model, width, height)
    assert np.array_equal(painted(model, "eye", width, height), full.draw(data, "eye"))
    full.close()


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, bool]]:
    """Of each picture that is drawn: how many geoms but a piece of floor, and whether the sky."""
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
DOWN = 'pos="0 0 1" fovy="90"'
LENS = 'pos="0 0 1" resolution="640 480" sensorsize="0.008 0.002" focal="0.002 0.001"'
WIDE = '<geom type="plane" size="3 3 1" rgba=".5 .5 .5 1"/>'
NARROW = '<geom type="plane" size="1.2 1.2 1"/>'  # the picture is 2 m high and 2.7 m wide there
BESIDE = '<geom size="0.1" pos="{} {} 0.5"/>'
CORNER = '<geom size="0.01" pos="{} {} 0.5"/>'
PLACES = [((2 * i - 7) / 12, (2 * j - 5) / 12) for j in range(6) for i in range(8)]
LOW_LEFT, ALL_BUT_LAST = PLACES[0], PLACES[:-1]
AROUND = '<geom type="ellipsoid" size="{}" pos="{}"/>'
BALL = '<geom size="0.1" pos="0.1 0.2 {}" rgba="1 0 0 {}"/>'


@pytest.mark.parametrize(
    ("assets", "world", "camera", "geoms", "sky"),
    [
        # A floor that fills the picture, below all else, is not drawn, and hides the sky.
        (FLAT, WIDE, DOWN, 0, False),
        (FLAT, WIDE + BALL.format(0.3, 1), DOWN, 1, False),
        (GRADED, WIDE + BALL.format(0.3, 1), DOWN, 1, False),
        (FLAT, WIDE, LENS, 0, False),
        (FLAT, '<geom type="plane" size="90 90 1" pos="0 0 -14"/>', DOWN, 0, False),
        # It is drawn where something is below it, or shines through, or has not one colour.
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
        # It is no matter what light is mirrored by who mirrors none.
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
        # A sky of one colour is not drawn.
        (FLAT, NARROW, DOWN, 1, False),
        ("", NARROW, DOWN, 1, False),
        (FLAT, BALL.format(0.3, 1), DOWN, 1, False),
        # It is drawn where it has more than one (rgb2 is below), or something shines through.
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
        # What is around the camera, near and not so near its middle.
        (FLAT, WIDE + '<geom size="0.1" pos="0 0 1.06"/>', DOWN, 0, False),
        (FLAT, WIDE + '<geom size="0.1" pos="0 0 1.08"/>', DOWN, 2, False),
        (FLAT, WIDE + AROUND.format("0.1 0.2 0.3", "0.05 0.05 1"), DOWN, 0, False),
        (FLAT, WIDE + BALL.format(1, 0.5).replace("0.1 0.2", "0 0"), DOWN, 0, False),
        (FLAT, WIDE + AROUND.format("0.1 0.2 0.3", "0.09 0.05 1"), DOWN, 2, False),
    ],
)
def test_what_is_drawn(
    assets: str, world: str, camera: str, geoms: int, sky: bool, drawn: list[tuple[int, bool]]
) -> None:
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><statistic extent='1'/><visual><headlight specular='0 0 0'/></visual>"
        f"<asset>{assets}</asset>"
        f"<worldbody>{world}<camera name='eye' {camera}/></worldbody></mujoco>"
    )
    painter, data = Painter(model), mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for _ in range(2):
        painter.draw(data, "eye")  # the first picture is drawn in full, too
    assert isinstance(painter._renderer, QuickRenderer)
    assert not painter._renderer._differs
    painter.close()
    assert drawn[-1] == (geoms, sky)
    assert_same(model)


def test_a_wire_beside_the_picture_is_not_drawn(drawn: list[tuple[int, bool]]) -> None:
    hidden = 'group="4"'
    sites = "".join(f'<site name="{i}" pos="{2 * i - 2} 0 0.5" {hidden}/>' for i in range(6))
    wire = "".join(f'<site site="{i}"/>' for i in range(6))
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{sites}<camera name='eye' {DOWN}/></worldbody>"
        f"<tendon><spatial name='wire'>{wire}</spatial></tendon></mujoco>"
    )
    painted(model, "eye")
    assert drawn[-2] == (2, False)  # of five parts, those that begin or end in the middle
    assert_same(model)


def test_what_somebody_adds_is_not_hidden_by_the_background(
    drawn: list[tuple[int, bool]],
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
    assert drawn[-2] == (2, False)
    for each in (painter, full):
        each.close()


def _tell_another_colour(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(QuickRenderer, "_colour", lambda self, behind: 0x0000FF)


def _read_nothing(patch: pytest.MonkeyPatch) -> None:
    gl = quick_renderer._gl
    patch.setattr(
        quick_renderer,
        "_gl",
        lambda name, *kinds: (lambda *_: None) if name == "glReadPixels" else gl(name, *kinds),
    )


@pytest.mark.parametrize("break_driver", [_tell_another_colour, _read_nothing])
def test_mujoco_draws_all_where_pictures_differ(
    break_driver: Callable[[pytest.MonkeyPatch], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{WIDE}<camera name='eye' {DOWN}/></worldbody></mujoco>"
    )
    data, full = mujoco.MjData(model), slow_painter(model)
    mujoco.mj_forward(model, data)
    break_driver(monkeypatch)
    painter = Painter(model)
    for _ in range(3):
        assert np.array_equal(painter.draw(data, "eye"), full.draw(data, "eye"))
    assert type(painter._renderer) is QuickRenderer
    for each in (painter, full):
        each.close()


def test_pictures_of_many_samples_a_pixel_are_mujocos() -> None:
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{WIDE}<camera name='eye' {DOWN}/></worldbody></mujoco>"
    )
    painter, data = Painter(model, quality={"offsamples": 4}), mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert painter.draw(data, "eye").any()
    assert type(painter._renderer) is mujoco.Renderer
    painter.close()


FLEX = (
    '<flexcomp name="cloth" type="grid" count="3 3 1" spacing="0.1 0.1 0.1" dim="2" rigid="true"/>'
)


def test_no_background_is_filled_in_where_geoms_do_not_tell_all(
    drawn: list[tuple[int, bool]],
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
        drawn.clear()
        painter, data = Painter(model), mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        for _ in range(2):
            painter.draw(data, "eye")
        painter.close()
        assert len(drawn) == 4  # two by two renderers at the opening, and each picture once


def test_painters_draw_in_turns() -> None:
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{WIDE}{BALL.format(0.3, 1)}<camera name='eye' {DOWN}/></worldbody>"
        "</mujoco>"
    )
    quick, small, full = Painter(model), Painter(model, 64, 48), slow_painter(model)
    data = mujoco.MjData(model)
    for place in (0.2, 0.4, 0.6):
        model.geom_pos[1, :2] = place
        mujoco.mj_forward(model, data)
        pictures = [painter.draw(data, "eye") for painter in (quick, full, small)]
        assert np.array_equal(pictures[0], pictures[1])
    for painter in (quick, small, full):
        painter.close()
