"""Rendering of a running model: offscreen, or in a window if there is a display."""

from __future__ import annotations

import importlib
import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from threading import Lock
from typing import Any

import mujoco
import numpy as np
from gymnasium import logger
from mujoco.rendering.classic import gl_context
from numpy.typing import NDArray

from kengoro_env.errors import RenderingError
from kengoro_env.stepping.c_compiler import library
from kengoro_env.vision import gl_backend
from kengoro_env.vision.quick_renderer import Image, QuickRenderer
from kengoro_env.vision.renderer import Renderer, refuse_in_a_fork
from kengoro_env.vision.simplified_scene import SimpleRenderer

WIDTH, HEIGHT = 640, 480
"""Size of an image [pixels]."""

Depths = NDArray[np.float32]


QUALITY = {"numslices": 16, "numstacks": 8, "numquads": 1, "offsamples": 0, "shadowsize": 0}
"""Visual quality with fewer faces of round geoms and boxes than MuJoCo's default, and without
anti-aliasing: they take most of the time, and do not improve the poses of markers."""

COARSE = {**QUALITY, "numslices": 12, "numstacks": 4}
"""Coarser quality for the camera in the head, which sees the arm but no skull and no rib cage."""

MOST_GEOMS = 1000
"""Largest number of geoms of a scene, above that of all scenes; MuJoCo's default of 10,000 takes
longer to allocate."""


def open_renderer(
    model: mujoco.MjModel,
    width: int = WIDTH,
    height: int = HEIGHT,
    quality: Mapping[str, int] = QUALITY,
    simple: bool = False,
) -> Renderer:
    """Renderer of a model, with the first of MuJoCo's GL backends that works here.

    MuJoCo's own renderers use that backend from then on.

    Args:
        model: the model.
        width: width of the images [pixels].
        height: height of the images [pixels].
        quality: `QUALITY` or `COARSE`.
        simple: whether to render simplified scenes without shadows and reflections; by a
            `QuickRenderer` if C code can be compiled and a pixel is one sample.

    Raises:
        RenderingError: no backend works, or this process is a fork of one that has rendered.
    """
    refuse_in_a_fork()
    chosen = os.environ.get("MUJOCO_GL")
    tried = gl_backend.candidates()
    reason = "no GL library found"
    for backend in tried:
        try:
            if backend in ("glfw", "egl", "osmesa"):
                gl_context.GLContext = importlib.import_module(f"mujoco.{backend}").GLContext
            with _cheap(model, width, height, quality):
                return _renderer(model, width, height, simple)
        # MuJoCo, PyOpenGL and drivers raise many types of errors.
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


def _renderer(model: mujoco.MjModel, width: int, height: int, simple: bool) -> Renderer:
    """A renderer that has rendered a first, empty image."""
    kind: Callable[..., Renderer] = SimpleRenderer if simple else Renderer
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
    """Set quality and image size of a model while a renderer is created."""
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
    """Renders a model offscreen, in any thread. The first image opens the GL context.

    A copied or unpickled painter opens a context of its own.

    Args:
        model: the model.
        width: width of the images [pixels].
        height: height of the images [pixels].
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
        self._renderer: Renderer | None = None
        self._lock = Lock()

    def draw(
        self,
        data: mujoco.MjData,
        camera: str,
        decorate: Callable[[mujoco.MjvScene], None] | None = None,
        visible: mujoco.MjvOption | None = None,
    ) -> Image:
        """Image of a camera (height, width, 3) uint8, RGB; a new array.

        Args:
            data: the state to render.
            camera: name of a camera of the model.
            decorate: adds geoms to the scene that are not in the model.
            visible: which elements are rendered; MuJoCo's default if left out.

        Raises:
            RenderingError: no GL backend works here, or this process is a fork of one that has
                rendered.
        """
        return np.asarray(self._image(data, camera, decorate, visible, depth=False))

    def depth(self, data: mujoco.MjData, camera: str) -> Depths:
        """Distances along a camera's axis (height, width) float32 [m], up to `farthest`.

        Args:
            data: the state to render.
            camera: name of a camera of the model.

        Raises:
            RenderingError: see `draw`.
        """
        return np.asarray(self._image(data, camera, None, None, depth=True))

    @property
    def farthest(self) -> float:
        """Distance of the far clipping plane, which empty pixels of `depth` have [m]."""
        return float(self._model.vis.map.zfar * self._model.stat.extent)

    def _image(
        self,
        data: mujoco.MjData,
        camera: str,
        decorate: Callable[[mujoco.MjvScene], None] | None,
        visible: mujoco.MjvOption | None,
        depth: bool,
    ) -> NDArray[Any]:
        """An image, or its depths."""
        refuse_in_a_fork()
        with self._lock:
            if self._renderer is None:
                self._renderer = open_renderer(
                    *(self._model, self._width, self._height, self._quality), simple=True
                )
            renderer = self._renderer
            try:
                scene = renderer.scene
                renderer.update_scene(data, camera, *(() if visible is None else (visible,)))
                # Shadows and reflections take most of the time, and make markers harder to detect.
                scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
                scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
                if decorate is not None:
                    decorate(scene)
                if depth:
                    renderer.enable_depth_rendering()
                return np.asarray(renderer.render())
            finally:
                renderer.disable_depth_rendering()
                renderer.release()

    def close(self) -> None:
        """Free the GL context; the next image opens another."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def __getstate__(self) -> dict[str, Any]:
        """State of a copy, without the GL context."""
        return {**self.__dict__, "_renderer": None, "_lock": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._lock = Lock()


def open_window(model: mujoco.MjModel, data: mujoco.MjData) -> Any:
    """MuJoCo's viewer on a running model; None, with a warning, if there is no display."""
    try:
        return open_viewer(model, data)
    except RenderingError as error:
        logger.warn(f'render_mode "human" opens no window: {error}; rendering offscreen instead')
        return None


def has_display() -> bool:
    """Whether a window can be opened here."""
    import glfw

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return bool(glfw.init())


def open_viewer(model: mujoco.MjModel, data: mujoco.MjData) -> Any:
    """MuJoCo's viewer on a running model.

    Raises:
        RenderingError: no window can be opened here.
    """
    import mujoco.viewer

    if not has_display():
        raise RenderingError("no display was found")
    try:
        return mujoco.viewer.launch_passive(model, data, show_left_ui=False, show_right_ui=False)
    except RuntimeError as error:  # on macOS, when Python was not started as mjpython
        raise RenderingError(str(error).splitlines()[0]) from error
