"""Images of models at rest, and parts of their MJCF."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from kengoro_env.vision import rendering
from kengoro_env.vision.rendering import HEIGHT, WIDTH, Image, Painter
from kengoro_env.vision.simplified_scene import SimpleRenderer

DOWN = 'pos="0 0 1" fovy="90"'
WIDE = '<geom type="plane" size="3 3 1" rgba=".5 .5 .5 1"/>'
BALL = '<geom size="0.1" pos="0.1 0.2 {}" rgba="1 0 0 {}"/>'


def painted(model: mujoco.MjModel, camera: str, width: int = WIDTH, height: int = HEIGHT) -> Image:
    """Image of a camera of a model (height, width, 3) uint8."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    painter = Painter(model, width, height)
    picture = painter.draw(data, camera)
    painter.close()
    return picture


def slow_painter(model: mujoco.MjModel, width: int = WIDTH, height: int = HEIGHT) -> Painter:
    """A painter that renders all geoms, after its first image."""
    painter, data = Painter(model, width, height), mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rendering, "library", lambda: None)
        painter.draw(data, model.camera(0).name)
    assert type(painter._renderer) is SimpleRenderer
    return painter


def assert_same(model: mujoco.MjModel, width: int = WIDTH, height: int = HEIGHT) -> None:
    """The camera "eye" of a model has the same image when all geoms are rendered."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    full = slow_painter(model, width, height)
    assert np.array_equal(painted(model, "eye", width, height), full.draw(data, "eye"))
    full.close()
