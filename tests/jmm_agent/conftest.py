"""Rendering without a display, chosen before MuJoCo is imported."""

from __future__ import annotations

import os
import sys
from ctypes.util import find_library

if sys.platform == "linux" and "DISPLAY" not in os.environ:
    os.environ.setdefault("MUJOCO_GL", "egl" if find_library("EGL") else "osmesa")
