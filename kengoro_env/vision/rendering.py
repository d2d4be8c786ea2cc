"""Pictures of a running model: drawn offscreen, or in a window where there is a display."""

from __future__ import annotations

import importlib
import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from typing import Any

import mujoco
from gymnasium import logger
from mujoco.rendering.classic import gl_context

from kengoro_env.errors import KengoroError
from kengoro_env.stepping.c_compiler import library
from kengoro_env.vision import gl_backend
from kengoro_env.vision.quick_renderer import Image, QuickRenderer
from kengoro_env.vision.simplified_scene import SimpleRenderer

WIDTH, HEIGHT = 640, 480
"""Size of every picture [pixels]."""


class RenderingError(KengoroError):
    """No GL library draws here; the message says what to install."""


QUALITY = {"numslices": 16, "numstacks": 8, "numquads": 1, "offsamples": 0, "shadowsize": 0}
"""Round things are drawn with fewer faces than MuJoCo's 28 x 16, sides of boxes with one where it
has 4 x 4, and without anti-aliasing: most of a picture's time went there, and the poses of markers
are no better for it."""

COARSE = {**QUALITY, "numslices": 12, "numstacks": 4}
"""For who sees no skull and no rib cage: along an arm, fewer faces look the same."""

MOST_GEOMS = 1000
"""More than any scene of the arm has; MuJoCo's 10,000 take long to make room for."""


def open_renderer(
    model: mujoco.MjModel,
    width: int = WIDTH,
    height: int = HEIGHT,
    quality: Mapping[str, int] = QUALITY,
    simple: bool = False,
) -> mujoco.Renderer:
    """A renderer of a model, with the first of MuJoCo's GL backends that draws here.

    MuJoCo's own renderers use that backend from then on.

    Args:
        model: what is drawn.
        width, height: of each picture [pixels].
        quality: `QUALITY` or `COARSE`.
        simple: of simplified scenes without shadows and reflections, by a `QuickRenderer` where
            code can be compiled and a pixel is one sample.

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
            with _cheap(model, width, height, quality):
                return _renderer(model, width, height, simple)
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


def _renderer(model: mujoco.MjModel, width: int, height: int, simple: bool) -> mujoco.Renderer:
    """A renderer that has drawn a first, empty picture."""
    kind: Callable[..., mujoco.Renderer] = SimpleRenderer if simple else mujoco.Renderer
    if simple and not model.vis.quality.offsamples and (compiled := library()) is not None:
        kind = partial(QuickRenderer, compiled)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        font = mujoco.mjtFontScale.mjFONTSCALE_50
        renderer = kind(model, height, width, MOST_GEOMS, font)
    renderer.render()
    return renderer


@contextmanager
def _cheap(
    model: mujoco.MjModel, width: int, height: int, quality: Mapping[str, int]
) -> Iterator[None]:
    """Lets a renderer that is made meanwhile draw no finer and no larger than it must."""
    visual = model.vis
    wanted = [(visual.quality, name, value) for name, value in quality.items()]
    wanted += [(visual.global_, "offwidth", width), (visual.global_, "offheight", height)]
    before = [getattr(group, name) for group, name, _ in wanted]
    for group, name, value in wanted:
        setattr(group, name, value)
    try:
        yield
    finally:
        for (group, name, _), value in zip(wanted, before, strict=True):
            setattr(group, name, value)


class Painter:
    """Draws a model offscreen; opens its GL context with the first picture.

    A copied or unpickled painter opens a context of its own.

    Args:
        model: what is drawn.
        width, height: of each picture [pixels].
        quality: `QUALITY` or `COARSE`.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        width: int = WIDTH,
        height: int = HEIGHT,
        quality: Mapping[str, int] = QUALITY,
    ) -> None:
        self._model, self._width, self._height = model, width, height
        self._quality = quality
        self._renderer: mujoco.Renderer | None = None

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
            self._renderer = open_renderer(
                *(self._model, self._width, self._height, self._quality), simple=True
            )
        scene = self._renderer.scene
        self._renderer.update_scene(data, camera)
        # Shadows and reflections cost most of the time, and markers are read better without.
        scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
        scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        if decorate is not None:
            decorate(scene)
        return self._renderer.render()

    def close(self) -> None:
        """Free the GL context; the next picture opens another."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_renderer": None}


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
