"""Which GL library MuJoCo draws with; decided before mujoco is imported, which reads it then.

The order is that of tools/ensure_rendering.py: GLFW where there is a display, then EGL, which
needs none, then OSMesa. Who sets MUJOCO_GL decides alone.
"""

from __future__ import annotations

import ctypes
import os
import sys

from kengoro_env.errors import KengoroError

LIBRARIES: dict[str, tuple[str, ...]] = {
    "egl": ("libEGL.so.1", "libEGL.so"),
    "osmesa": ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"),
}
"""Shared libraries that a backend cannot do without, under the names that they may have."""


def is_there(backend: str) -> bool:
    """Whether the library of a backend of `LIBRARIES` loads."""
    for name in LIBRARIES[backend]:
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return True
    return False


def candidates() -> tuple[str, ...]:
    """MuJoCo's backends that may work here, best first; "" stands for MuJoCo's own choice."""
    chosen = os.environ.get("MUJOCO_GL", "")
    if chosen or sys.platform != "linux":
        return (chosen.lower().strip(),)
    on_display = ("glfw",) if os.environ.get("DISPLAY") else ()
    return (*on_display, *(backend for backend in LIBRARIES if is_there(backend)))


def choose() -> None:
    """Set MUJOCO_GL where a mujoco imported later would choose a backend that needs a display.

    Does nothing where the user chose, where there is a display, where mujoco was imported before
    (`rendering` then finds a backend of its own) and where no library is found.

    Raises:
        KengoroError: the user chose a backend without whose library mujoco cannot be imported.
    """
    chosen = os.environ.get("MUJOCO_GL", "")
    if "mujoco" in sys.modules or (os.environ.get("DISPLAY") and not chosen):
        return
    found = candidates()
    if chosen and found[0] in LIBRARIES and sys.platform == "linux" and not is_there(found[0]):
        raise KengoroError(
            f"MUJOCO_GL={chosen} is set, but {LIBRARIES[found[0]][0]} is not there: unset it, or "
            "install the libraries of that backend"
        )
    if found and found[0]:
        os.environ["MUJOCO_GL"] = found[0]
