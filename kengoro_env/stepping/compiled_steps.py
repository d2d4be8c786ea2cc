"""Structures of control_step.c, filled with the places of the arrays of some robots."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kengoro_env.robot.robot import Robot
from kengoro_env.spaces import LengthBounds
from kengoro_env.stepping.lift_monitor import TrackedObject

DONE, NOT_AN_ACTION, DIVERGED, BROKEN = range(4)
"""What may come of a step."""


class Friction(ctypes.Structure):
    """``Friction`` of control_step.c."""

    _fields_ = [
        ("count", ctypes.c_int64),
        *((name, ctypes.c_void_p) for name in ("loss", "actuator", "ratio", "constant")),
    ]


class Step(ctypes.Structure):
    """``Step`` of control_step.c."""

    _fields_ = [
        ("model", ctypes.c_void_p),
        ("data", ctypes.c_void_p),
        *((n, ctypes.c_int64) for n in ("substeps", "muscles", "joints", "fingers", "grip")),
        *((n, ctypes.c_int64) for n in ("thing", "thing_geom")),
        *((n, ctypes.c_void_p) for n in ("who", "thing_pose")),
        *((n, ctypes.c_void_p) for n in ("tendon", "actuator", "spool", "drum", "elongation")),
        *((n, ctypes.c_void_p) for n in ("stiffness", "bias", "limit", "damping", "polynomial")),
        ("friction", Friction * 2),
        *((n, ctypes.c_void_p) for n in ("length_offset", "length_noise", "length_quantum")),
        *((n, ctypes.c_void_p) for n in ("tension_offset", "tension_noise", "noise")),
        *((n, ctypes.c_void_p) for n in ("zero", "position", "left_at")),
        *((n, ctypes.c_void_p) for n in ("half", "middle", "low", "high", "most_tension")),
        *((n, ctypes.c_void_p) for n in ("action", "goal", "target", "told", "pose")),
        ("reason", ctypes.c_char * 256),
    ]


class Steps:
    """Control steps of robots of one kind: where compiled code reads and writes.

    Args:
        robots: of one model, ``count`` of them.
        bounds: of the wires' lengths.
        thing: that the hand of the only robot is to lift; None for nothing.

    Attributes:
        structures: (count,), for the compiled code.
        actions: (count, m + 1), the last entry for the fingers, -1: open.
        noise: (count, k), standard normal, drawn anew for each step.
        told: (count, 4 m + n + 5), see ``tell`` of control_step.c.
        parts: which of these columns are lengths, tensions, slack paid out and beyond the target,
            joint angles, and the numbers error, tension and time, and the thing's distance and by
            whom it is touched, 0 where there is none.
        poses: (count, 4, 4) of the grip.
        thing_pose: (4, 4).
    """

    def __init__(
        self, robots: Sequence[Robot], bounds: LengthBounds, thing: TrackedObject | None = None
    ) -> None:
        count, first = len(robots), robots[0]
        m, n = len(first.muscles), len(first.joints)
        self.actions = np.full((count, m + 1), -1.0)
        self.noise = np.zeros((count, m * first.kinds_of_noise))
        ends = (*range(0, 4 * m + 1, m), 4 * m + n, 4 * m + n + 5)
        self.parts = tuple(map(slice, ends, ends[1:]))
        self.told = np.zeros((count, ends[-1]))
        self.poses = np.tile(np.eye(4), (count, 1, 1))
        self.object_pose = np.eye(4)
        watched = {"thing": -1} if thing is None else thing.layout()
        self.structures = (Step * count)()
        self._kept: list[Any] = []  # what pointers point to
        for i, (structure, robot) in enumerate(zip(self.structures, robots, strict=True)):
            own = {
                "action": self.actions[i],
                "noise": self.noise[i],
                "told": self.told[i],
                "pose": self.poses[i],
                "thing_pose": self.object_pose,
                **watched,
            }
            self._fill(structure, {**robot.layout(), **bounds.layout(), **own})
            for place, friction in zip(structure.friction, robot.motors.frictions, strict=False):
                self._fill(place, friction.layout(robot.model))

    def aim(self, i: int, goal: NDArray[np.float64] | None) -> None:
        """Judge the ``i``-th robot by a goal (n,) [rad] that lives on; None: by none."""
        self.structures[i].goal = None if goal is None else goal.ctypes.data

    def reason(self, i: int) -> str:
        """Why the step of the ``i``-th robot broke, in MuJoCo's words."""
        return self.structures[i].reason.decode(errors="replace")

    def _fill(self, structure: ctypes.Structure, values: Mapping[str, Any]) -> None:
        """Write numbers, and where arrays lie."""
        for name, value in values.items():
            if isinstance(value, np.ndarray):
                assert value.flags.c_contiguous, name
                assert value.dtype in (np.float64, np.int64), name
                self._kept.append(value)
                value = value.ctypes.data
            setattr(structure, name, value)
