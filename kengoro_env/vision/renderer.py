"""MuJoCo's renderer, for programs with several threads and processes.

A GL context is current in one thread at a time, and only there can it be used or freed. `Painter`
releases it after each image, so that any thread may render the next one. A context that was not
released belongs to the thread that made it. The garbage collector runs in any thread, so such a
renderer that it finds elsewhere waits until its thread makes another one.

A fork copies contexts without the threads that render for them: the copy would wait forever for
them. So a process that was forked after the first image renders none, and frees no context.
"""

from __future__ import annotations

import os
import sys
import threading
from typing import Any

import mujoco
from mujoco.rendering.classic import gl_context

from kengoro_env.errors import RenderingError

_waiting: list[Renderer] = []
"""Renderers to be freed by their own threads, or never, in a fork."""

_rendering: list[int] = []
"""The process that made the first renderer."""


class Renderer(mujoco.Renderer):
    """A `mujoco.Renderer` that is freed in the thread that made it, unless it was released.

    Raises:
        RenderingError: this process was forked from one that had rendered.
    """

    def __init__(self, model: mujoco.MjModel, *args: Any) -> None:
        refuse_in_a_fork()
        self._process, self._thread = os.getpid(), threading.get_ident()
        self._is_released = False
        for renderer in [found for found in _waiting if found._thread == self._thread]:
            _waiting.remove(renderer)
            renderer.close()
        super().__init__(model, *args)
        _rendering[:] = [self._process]

    def release(self) -> None:
        """Let any thread render the next image."""
        context = gl_context.GLContext
        module = "" if context is None else context.__module__
        if module == "mujoco.egl":
            egl, calls = sys.modules[module], sys.modules["mujoco.egl.egl_ext"]
            nothing = (calls.EGL_NO_SURFACE, calls.EGL_NO_SURFACE, calls.EGL_NO_CONTEXT)
            calls.eglMakeCurrent(egl.EGL_DISPLAY, *nothing)
        elif module == "mujoco.glfw":
            sys.modules["glfw"].make_context_current(None)
        self._is_released = True

    def close(self) -> None:
        """Free the context; in a fork, leave it."""
        if self._process == os.getpid():
            super().close()
        else:
            _waiting.append(self)

    def __del__(self) -> None:
        """Free the context here, or leave that to the thread in which it is current."""
        if not hasattr(self, "_mjr_context"):
            return  # its creation failed
        if self._is_released or self._thread == threading.get_ident():
            self.close()
        else:
            _waiting.append(self)


def _leave_display() -> None:
    """Keep a fork from terminating the display of its parent when it exits, which never ends."""
    if "mujoco.egl" in sys.modules:
        sys.modules["mujoco.egl"].EGL_DISPLAY = None  # type: ignore[attr-defined]


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_leave_display)


def refuse_in_a_fork() -> None:
    """Raise an error if this process was forked from one that had rendered.

    Raises:
        RenderingError: it was.
    """
    if _rendering and _rendering[0] != os.getpid():
        raise RenderingError(
            "this process was forked from one that had rendered an image, and cannot render: start "
            'it by spawn, as AsyncVectorEnv(..., context="spawn") does, or render the first image '
            "after the fork"
        )
