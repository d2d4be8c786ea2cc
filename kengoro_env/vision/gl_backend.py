"""Choice of the GL library that MuJoCo renders with, before mujoco is imported and reads it.

The order is that of tools/ensure_rendering.py: GLFW if a display opens, then EGL, which needs none,
then OSMesa. The environment variable MUJOCO_GL overrides the choice. A display is tried before
GLFW, for after GLFW has failed on a display that is gone, MuJoCo cannot use EGL in that process.
"""

from __future__ import annotations

import ctypes
import os
import sys
from functools import cache

from kengoro_env.errors import RenderingError

LIBRARIES: dict[str, tuple[str, ...]] = {
    "egl": ("libEGL.so.1", "libEGL.so"),
    "osmesa": ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"),
}
"""Shared library that a backend needs, under its possible names."""

BACKENDS = {
    "linux": ("egl", "osmesa", "glfw", "glx"),
    "win32": ("glfw", "wgl"),
    "darwin": ("glfw", "cgl"),
}
"""Backends that MUJOCO_GL may name, by platform."""

SWITCHES = (
    *("", "1", "on", "true", "enable", "enabled"),
    *("0", "off", "false", "disable", "disabled"),
)
"""Values of MUJOCO_GL that name no backend: MuJoCo's own choice, or no rendering."""

X11 = ("libX11.so.6", "libX11.so")
"""Library of the X window system, under its possible names."""


def is_installed(backend: str) -> bool:
    """Whether the library of a backend of `LIBRARIES` loads."""
    return _load(LIBRARIES[backend]) is not None


def display_opens() -> bool:
    """Whether the display that the environment variable DISPLAY names can be opened."""
    name = os.environ.get("DISPLAY", "")
    return bool(name) and _opens(name)


@cache
def _opens(name: str) -> bool:
    """Whether the display ``name`` can be opened; one of a closed connection cannot."""
    x11 = _load(X11)
    if x11 is None:
        return False
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XOpenDisplay.argtypes = [ctypes.c_char_p]
    display = x11.XOpenDisplay(name.encode())
    if not display:
        return False
    x11.XCloseDisplay.argtypes = [ctypes.c_void_p]
    x11.XCloseDisplay(display)
    return True


def _load(names: tuple[str, ...]) -> ctypes.CDLL | None:
    """Load the first library that is installed; None if none is."""
    for name in names:
        try:
            return ctypes.CDLL(name)
        except OSError:
            continue
    return None


def candidates() -> tuple[str, ...]:
    """MuJoCo's backends that may work here, best first; "" is MuJoCo's own choice."""
    chosen = os.environ.get("MUJOCO_GL", "")
    if chosen or sys.platform != "linux":
        return (chosen.lower().strip(),)
    on_display = ("glfw",) if display_opens() else ()
    return (*on_display, *(backend for backend in LIBRARIES if is_installed(backend)))


def choose() -> None:
    """Set MUJOCO_GL if mujoco, imported later, would choose a backend that needs a display.

    Does nothing if MUJOCO_GL is set, if a display opens, if mujoco is imported already
    (`rendering` then chooses the backend) or if no library is found.

    Raises:
        RenderingError: MUJOCO_GL names no backend, or one whose library is not installed.
    """
    chosen = os.environ.get("MUJOCO_GL", "")
    if "mujoco" in sys.modules or (not chosen and display_opens()):
        return
    found = candidates()
    if chosen and found[0] not in (*SWITCHES, *BACKENDS.get(sys.platform, ())):
        valid = ", ".join(BACKENDS.get(sys.platform, ()))
        raise RenderingError(
            f"MUJOCO_GL={chosen} is set, but MuJoCo has no such backend: unset it, or set it to "
            f"one of {valid}, or to disabled"
        )
    if chosen and found[0] in LIBRARIES and sys.platform == "linux" and not is_installed(found[0]):
        raise RenderingError(
            f"MUJOCO_GL={chosen} is set, but {LIBRARIES[found[0]][0]} is not installed: unset it, "
            "or install the libraries of that backend"
        )
    if found and found[0]:
        os.environ["MUJOCO_GL"] = found[0]
