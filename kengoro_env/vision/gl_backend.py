"""Choice of the GL library that MuJoCo renders with, before mujoco is imported and reads it.

The order is that of tools/ensure_rendering.py: GLFW if there is a display, then EGL, which needs
none, then OSMesa. The environment variable MUJOCO_GL overrides the choice.
"""

from __future__ import annotations

import ctypes
import os
import sys

from kengoro_env.errors import RenderingError

LIBRARIES: dict[str, tuple[str, ...]] = {
    "egl": ("libEGL.so.1", "libEGL.so"),
    "osmesa": ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"),
}
"""Shared library that a backend needs, under its possible names."""


def is_installed(backend: str) -> bool:
    """Whether the library of a backend of `LIBRARIES` loads."""
    for name in LIBRARIES[backend]:
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return True
    return False


def candidates() -> tuple[str, ...]:
    """MuJoCo's backends that may work here, best first; "" is MuJoCo's own choice."""
    chosen = os.environ.get("MUJOCO_GL", "")
    if chosen or sys.platform != "linux":
        return (chosen.lower().strip(),)
    on_display = ("glfw",) if os.environ.get("DISPLAY") else ()
    return (*on_display, *(backend for backend in LIBRARIES if is_installed(backend)))


def choose() -> None:
    """Set MUJOCO_GL if mujoco, imported later, would choose a backend that needs a display.

    Does nothing if MUJOCO_GL is set, if there is a display, if mujoco is imported already
    (`rendering` then chooses the backend) or if no library is found.

    Raises:
        RenderingError: MUJOCO_GL names a backend whose library is not installed.
    """
    chosen = os.environ.get("MUJOCO_GL", "")
    if "mujoco" in sys.modules or (os.environ.get("DISPLAY") and not chosen):
        return
    found = candidates()
    if chosen and found[0] in LIBRARIES and sys.platform == "linux" and not is_installed(found[0]):
        raise RenderingError(
            f"MUJOCO_GL={chosen} is set, but {LIBRARIES[found[0]][0]} is not installed: unset it, "
            "or install the libraries of that backend"
        )
    if found and found[0]:
        os.environ["MUJOCO_GL"] = found[0]
