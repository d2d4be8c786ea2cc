"""Images without the invisible geoms have the pixels of images with all geoms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest

from kengoro_env.assets import asset_path
from kengoro_env.departures import TendonStretch
from kengoro_env.robot.robot import Robot
from kengoro_env.stepping.c_compiler import library
from kengoro_env.vision import quick_renderer
from kengoro_env.vision.quick_renderer import QuickRenderer
from kengoro_env.vision.rendering import HEIGHT, WIDTH, Painter
from kengoro_env.vision.simplified_scene import SimpleRenderer
from tests.kengoro_env.vision.frames import BALL, DOWN, WIDE, assert_same, slow_painter

pytestmark = pytest.mark.skipif(library() is None, reason="there is no compiled code here")


@pytest.mark.parametrize("stretches", [False, True])
@pytest.mark.parametrize("scene", ["posture", "can_grasp", "elbow"])
def test_a_robot_has_the_same_pixels(scene: str, stretches: bool) -> None:
    departures = (TendonStretch(1e-5),) if stretches else ()
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
    """Geoms of all types around a camera above a floor, some of them below it."""
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
def test_geoms_have_the_same_pixels_in_every_position(lens: dict[str, Any]) -> None:
    rng = np.random.default_rng(0)
    for i in range(10):
        assert_same(scattered(rng, lens).compile(), *((131, 90) if i % 2 else (WIDTH, HEIGHT)))


def _return_another_colour(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(QuickRenderer, "_colour", lambda self, behind: 0x0000FF)


def _read_nothing(patch: pytest.MonkeyPatch) -> None:
    gl = quick_renderer._gl
    patch.setattr(
        quick_renderer,
        "_gl",
        lambda name, *kinds: (lambda *_: None) if name == "glReadPixels" else gl(name, *kinds),
    )


@pytest.mark.parametrize("break_driver", [_return_another_colour, _read_nothing])
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
    assert type(painter._renderer) is SimpleRenderer
    painter.close()


def test_painters_draw_in_turns() -> None:
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{WIDE}{BALL.format(0.3, 1)}<camera name='eye' {DOWN}/></worldbody>"
        "</mujoco>"
    )
    quick, small, full = Painter(model), Painter(model, 64, 48), slow_painter(model)
    data = mujoco.MjData(model)
    for position in (0.2, 0.4, 0.6):
        model.geom_pos[1, :2] = position
        mujoco.mj_forward(model, data)
        pictures = [painter.draw(data, "eye") for painter in (quick, full, small)]
        assert np.array_equal(pictures[0], pictures[1])
    for painter in (quick, small, full):
        painter.close()
