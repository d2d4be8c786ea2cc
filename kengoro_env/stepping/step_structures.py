"""The structures of control_step.c as ctypes: same fields, same order."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Friction(ctypes.Structure):
    """``Friction`` of control_step.c."""

    _fields_ = [
        ("count", ctypes.c_int64),
        *((name, ctypes.c_void_p) for name in ("loss", "actuator", "ratio", "constant")),
    ]


class Step(ctypes.Structure):
    """``Step`` of control_step.c: one robot."""

    _fields_ = [
        ("model", ctypes.c_void_p),
        ("data", ctypes.c_void_p),
        *((n, ctypes.c_int64) for n in ("substeps", "muscles", "joints", "fingers", "grip")),
        *((n, ctypes.c_int64) for n in ("object", "object_geom")),
        *((n, ctypes.c_void_p) for n in ("toucher", "object_pose")),
        *((n, ctypes.c_void_p) for n in ("tendon", "actuator", "spool", "drum", "elongation")),
        *((n, ctypes.c_void_p) for n in ("stiffness", "bias", "limit", "damping", "polynomial")),
        ("friction", Friction * 2),
        *((n, ctypes.c_void_p) for n in ("length_offset", "length_noise", "length_quantum")),
        *((n, ctypes.c_void_p) for n in ("tension_offset", "tension_noise")),
        *((n, ctypes.c_void_p) for n in ("noise", "random")),
        *((n, ctypes.c_void_p) for n in ("zero", "position", "left_at")),
        *((n, ctypes.c_void_p) for n in ("half", "middle", "low", "high", "most_tension")),
        *((n, ctypes.c_void_p) for n in ("action", "goal")),
        ("until", ctypes.c_void_p),
        *((n, ctypes.c_double) for n in ("tolerance", "reward_scale", "effort", "effort_scale")),
        *((n, ctypes.c_void_p) for n in ("target", "lengths", "tensions")),
        *((n, ctypes.c_void_p) for n in ("slack_paid_out", "slack_target", "joint_angles")),
        *((n, ctypes.c_void_p) for n in ("hand_pose", "error", "tension", "time")),
        *((n, ctypes.c_void_p) for n in ("distance", "touched", "reward", "success", "due")),
        ("reason", ctypes.c_char * 256),
    ]


class Fleet(ctypes.Structure):
    """``Fleet`` of control_step.c: robots that are stepped together."""

    _fields_ = [
        *((n, ctypes.c_void_p) for n in ("steps", "moving", "outcomes", "taken")),
        *((n, ctypes.c_int64) for n in ("count", "threads")),
        ("helpers", ctypes.c_void_p),
        ("done", ctypes.c_int64),
    ]


def fill(structure: ctypes.Structure, values: Mapping[str, Any]) -> list[NDArray[Any]]:
    """Write numbers and addresses of arrays into fields; None becomes NULL.

    Returns:
        The arrays that fields point to; they must outlive the structure.
    """
    arrays = []
    for name, value in values.items():
        if isinstance(value, np.ndarray):
            assert value.flags.c_contiguous, name
            assert value.dtype in (np.float64, np.int64, np.bool_), name
            arrays.append(value)
            value = value.ctypes.data
        setattr(structure, name, value)
    return arrays
