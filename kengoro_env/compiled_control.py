"""Control steps in compiled code: the bits of `Control`, in a fraction of its time."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.compiling import library
from kengoro_env.control import Control, Told
from kengoro_env.robot import DivergedError, Robot
from kengoro_env.spaces import LengthBounds, checked_action

Array = NDArray[np.float64]

_DONE, _NOT_AN_ACTION, _DIVERGED, _BROKEN = range(4)


class _Friction(ctypes.Structure):
    """``Friction`` of control_step.c."""

    _fields_ = [
        ("count", ctypes.c_int64),
        *((name, ctypes.c_void_p) for name in ("loss", "actuator", "ratio", "constant")),
    ]


class _Step(ctypes.Structure):
    """``Step`` of control_step.c."""

    _fields_ = [
        ("model", ctypes.c_void_p),
        ("data", ctypes.c_void_p),
        *((n, ctypes.c_int64) for n in ("substeps", "muscles", "joints", "fingers", "grip")),
        *((n, ctypes.c_void_p) for n in ("tendon", "actuator", "spool", "drum", "elongation")),
        *((n, ctypes.c_void_p) for n in ("stiffness", "bias", "limit", "damping", "polynomial")),
        ("friction", _Friction * 2),
        *((n, ctypes.c_void_p) for n in ("length_offset", "length_noise", "length_quantum")),
        *((n, ctypes.c_void_p) for n in ("tension_offset", "tension_noise", "noise")),
        *((n, ctypes.c_void_p) for n in ("zero", "position", "left_at")),
        *((n, ctypes.c_void_p) for n in ("half", "middle", "low", "high", "most_tension")),
        *((n, ctypes.c_void_p) for n in ("action", "goal", "target", "told", "pose")),
    ]


def control_of(robot: Robot, bounds: LengthBounds, entries: Sequence[str]) -> Control:
    """Control steps of a robot, compiled where that is possible; arguments as of `Control`."""
    compiled = library()
    if compiled is None:
        return Control(robot, bounds, entries)
    return CompiledControl(robot, bounds, entries, compiled)


class CompiledControl(Control):
    """Control steps of a robot by compiled code.

    Args:
        robot: acts.
        bounds: of the wires' lengths, for actions and observations.
        entries: names of the entries of an action.
        compiled: the code, of `library`.
    """

    def __init__(
        self,
        robot: Robot,
        bounds: LengthBounds,
        entries: Sequence[str],
        compiled: ctypes.CDLL,
    ) -> None:
        super().__init__(robot, bounds, entries)
        m, n = len(robot.muscles), len(robot.joints)
        self._shape = (len(entries),)
        action = np.full(m + 1, -1.0)  # fingers that are no entry stay open
        self._action = action[: len(entries)]
        self._noise = np.zeros(m * robot.kinds_of_noise)
        self._noisy = robot.kinds_of_noise > 0
        self._told, self._pose = np.zeros(4 * m + n + 3), np.eye(4)
        ends = (*range(0, 4 * m + 1, m), 4 * m + n, 4 * m + n + 3)
        self._parts = tuple(map(slice, ends, ends[1:]))
        self._goal: Array | None = None
        step = self._step = _Step()
        own = ("action", "noise", "told", "pose")
        values = {**robot.layout(), **bounds.layout()}
        values |= {name: getattr(self, f"_{name}") for name in own}
        kept = [_fill(step, values)]
        for place, friction in zip(step.friction, robot.motors.frictions, strict=False):
            kept.append(_fill(place, friction.layout(robot.model)))
        self._kept = kept  # while pointers point to them
        self._run = partial(compiled.control_step, ctypes.byref(step))
        self._why = compiled.why_it_broke

    def step(self, action: object, goal: Array | None) -> Told:
        """Carry out ``action`` for a control period; as `Control.step`."""
        robot = self._robot
        if type(action) is not np.ndarray or action.shape != self._shape:
            action = checked_action(action, self._entries)
        try:
            self._action[:] = action
        except (TypeError, ValueError):
            self._action[:] = checked_action(action, self._entries)  # which says what is wrong
        if goal is not self._goal:
            self._goal = goal
            self._step.goal = None if goal is None else goal.ctypes.data
        if robot.events:
            robot.let_wires_give()
        if self._noisy:
            robot.random.standard_normal(out=self._noise)
        state = self._run()
        if state == _NOT_AN_ACTION:
            checked_action(action, self._entries)
        if state == _BROKEN:
            raise mujoco.FatalError(self._why().decode())
        if state == _DIVERGED:
            raise DivergedError
        told = self._told.copy()
        lengths, tensions, slack, beyond, angles, numbers = self._parts
        error, tension, time = told[numbers].tolist()
        truth = {
            "joint_angles": told[angles],
            "hand_pose": self._pose.copy(),
            "slack_paid_out": told[slack],
            "slack_target": told[beyond],
            "time": time,
        }
        return {"lengths": told[lengths], "tensions": told[tensions]}, truth, error, tension


def _fill(structure: ctypes.Structure, values: Mapping[str, Any]) -> list[NDArray[Any]]:
    """Write numbers, and where arrays lie; gives back the arrays, which must live on."""
    kept = []
    for name, value in values.items():
        if isinstance(value, np.ndarray):
            assert value.flags.c_contiguous, name
            assert value.dtype in (np.float64, np.int64), name
            kept.append(value)
            value = value.ctypes.data
        setattr(structure, name, value)
    return kept
