"""MuJoCo's renderer, freed in the thread that made it.

The GL context of a renderer is current in its own thread, and no other thread can free it. The
garbage collector runs in any thread, so a renderer that it finds elsewhere waits until its thread
makes another one.
"""

from __future__ import annotations

import threading
from typing import Any

import mujoco

_waiting: list[Renderer] = []
"""Renderers to be freed by their own threads."""


class Renderer(mujoco.Renderer):
    """A `mujoco.Renderer` that is freed in the thread that made it."""

    def __init__(self, model: mujoco.MjModel, *args: Any) -> None:
        self._thread = threading.get_ident()
        for renderer in [found for found in _waiting if found._thread == self._thread]:
            _waiting.remove(renderer)
            renderer.close()
        super().__init__(model, *args)

    def __del__(self) -> None:
        """Free the context here, or leave that to the thread in which it is current."""
        if not hasattr(self, "_mjr_context"):
            return  # its creation failed
        if self._thread == threading.get_ident():
            self.close()
        else:
            _waiting.append(self)
