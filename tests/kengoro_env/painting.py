"""Pictures of models at rest."""

from __future__ import annotations

import mujoco

from kengoro_env.rendering import HEIGHT, WIDTH, Image, Painter


def painted(model: mujoco.MjModel, camera: str, width: int = WIDTH, height: int = HEIGHT) -> Image:
    """What a camera of a model sees, (height, width, 3) uint8."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    painter = Painter(model, width, height)
    picture = painter.draw(data, camera)
    painter.close()
    return picture
