"""Pictures of a running model: drawn offscreen, or in a window where there is a display."""

from __future__ import annotations

import importlib
import os
import warnings
from collections.abc import Callable
from functools import cache
from typing import Any

import mujoco
import numpy as np
from gymnasium import logger
from mujoco.rendering.classic import gl_context
from numpy.typing import NDArray

from kengoro_env import gl_backend
from kengoro_env.errors import KengoroError
from kengoro_env.wires import spool_joint

Image = NDArray[np.uint8]

WIDTH, HEIGHT = 640, 480
"""Size of every picture [pixels]."""


class RenderingError(KengoroError):
    """No GL library draws here; the message says what to install."""


@cache
def working_backend() -> str:
    """Name of a GL backend that draws here; MuJoCo's renderers use it from then on.

    Raises:
        RenderingError: there is none.
    """
    chosen = os.environ.get("MUJOCO_GL")
    tried = gl_backend.candidates()
    reason = "no GL library found"
    for backend in tried:
        try:
            if backend in ("glfw", "egl", "osmesa"):
                gl_context.GLContext = importlib.import_module(f"mujoco.{backend}").GLContext
            _draw_something()
            return backend
        # What a broken driver raises is up to MuJoCo, PyOpenGL and the driver.
        except Exception as error:
            reason = f"{backend or 'default'}: {type(error).__name__}"
            if str(error).strip():
                reason = f"{backend or 'default'}: {str(error).strip().splitlines()[0]}"
    if chosen and chosen == tried[0]:
        raise RenderingError(
            f"MuJoCo cannot render with MUJOCO_GL={chosen} ({reason}): unset it, or install the "
            "libraries of that backend"
        )
    raise RenderingError(
        f"MuJoCo cannot render here ({reason}): install EGL with Mesa's drivers, on Debian or "
        "Ubuntu `apt-get install libegl1 libgl1 libgl1-mesa-dri libopengl0`"
    )


def _draw_something() -> None:
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with mujoco.Renderer(model, 16, 16) as renderer:
            renderer.render()


class Painter:
    """Draws a model offscreen; opens its GL context with the first picture.

    A copied or unpickled painter opens a context of its own.

    Args:
        model: what is drawn.
        width, height: of each picture [pixels].
    """

    def __init__(self, model: mujoco.MjModel, width: int = WIDTH, height: int = HEIGHT) -> None:
        self._model, self._width, self._height = model, width, height
        self._renderer: mujoco.Renderer | None = None
        self._spooled = {
            i for i in range(model.ntendon) if _has_joint(model, spool_joint(model.tendon(i).name))
        }

    def draw(
        self,
        data: mujoco.MjData,
        camera: str,
        decorate: Callable[[mujoco.MjvScene], None] | None = None,
    ) -> Image:
        """What a camera sees, (height, width, 3) uint8, RGB; a new array.

        Args:
            data: the state that is drawn.
            camera: a camera of the model.
            decorate: adds geoms to the scene that are not in the model.

        Raises:
            RenderingError: there is no way to draw here.
        """
        if self._renderer is None:
            working_backend()
            self._renderer = mujoco.Renderer(self._model, self._height, self._width)
        scene = self._renderer.scene
        self._renderer.update_scene(data, camera)
        # Shadows and reflections cost most of the time, and markers are read better without.
        scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
        scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._hide_spools(scene)
        if decorate is not None:
            decorate(scene)
        return self._renderer.render()

    def _hide_spools(self, scene: mujoco.MjvScene) -> None:
        """Leave out the part of each wire that is wound up: the first one, from spool to guide."""
        wound_up = set(self._spooled)
        for geom in scene.geoms[: scene.ngeom]:
            if geom.objtype == mujoco.mjtObj.mjOBJ_TENDON and geom.objid in wound_up:
                wound_up.remove(geom.objid)
                geom.type = mujoco.mjtGeom.mjGEOM_NONE

    def close(self) -> None:
        """Free the GL context; the next picture opens another."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_renderer": None}


def _has_joint(model: mujoco.MjModel, name: str) -> bool:
    return bool(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) >= 0)


def open_window(model: mujoco.MjModel, data: mujoco.MjData) -> Any:
    """MuJoCo's viewer on a running model, or None with one warning where there is no display."""
    try:
        return open_viewer(model, data)
    except RenderingError as error:
        logger.warn(f'render_mode "human" opens no window: {error}; drawing offscreen instead')
        return None


def has_display() -> bool:
    """Whether windows can be opened here."""
    import glfw

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return bool(glfw.init())


def open_viewer(model: mujoco.MjModel, data: mujoco.MjData) -> Any:
    """MuJoCo's viewer on a running model.

    Raises:
        RenderingError: no window can be opened here, and why.
    """
    import mujoco.viewer

    if not has_display():
        raise RenderingError("no display was found")
    try:
        return mujoco.viewer.launch_passive(model, data, show_left_ui=False, show_right_ui=False)
    except RuntimeError as error:  # on macOS, when Python was not started as mjpython
        raise RenderingError(str(error).splitlines()[0]) from error
