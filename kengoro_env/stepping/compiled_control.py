"""Control steps in compiled code: the bits of `Control`, in a fraction of its time."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import partial

import mujoco
import numpy as np

from kengoro_env.robot.robot import DivergedError, Robot
from kengoro_env.spaces import LengthBounds, checked_action
from kengoro_env.stepping.c_compiler import library
from kengoro_env.stepping.compiled_steps import BROKEN, DIVERGED, NOT_AN_ACTION, Steps
from kengoro_env.stepping.control import Control, Told
from kengoro_env.stepping.lift_monitor import Sight
from kengoro_env.types import Floats


def control_of(
    robot: Robot, bounds: LengthBounds, entries: Sequence[str], thing: str | None
) -> Control:
    """Control steps of a robot, compiled where that is possible; arguments as of `Control`."""
    compiled = library()
    if compiled is None:
        return Control(robot, bounds, entries, thing)
    return CompiledControl(robot, bounds, entries, thing, compiled)


class CompiledControl(Control):
    """Control steps of a robot by compiled code.

    Args:
        robot: acts.
        bounds: of the wires' lengths, for actions and observations.
        entries: names of the entries of an action.
        thing: that the hand is to lift, a body's name; None for nothing.
        compiled: the code, of `library`.
    """

    def __init__(
        self,
        robot: Robot,
        bounds: LengthBounds,
        entries: Sequence[str],
        thing: str | None,
        compiled: ctypes.CDLL,
    ) -> None:
        super().__init__(robot, bounds, entries, thing)
        self._steps = steps = Steps([robot], bounds, self._thing)
        self._shape = (len(entries),)
        self._action = steps.actions[0, : len(entries)]
        self._noise, self._noisy = steps.noise[0], bool(steps.noise.size)
        self._told, self._pose, self._thing_pose = steps.told[0], steps.poses[0], steps.object_pose
        self._goal: Floats | None = None
        one = ctypes.byref(steps.structures[0])
        self._run = partial(compiled.control_step, one)
        self._act, self._tell = partial(compiled.act, one), partial(compiled.tell, one)

    def step(self, action: object, goal: Floats | None) -> Told:
        """Carry out ``action`` for a control period; as `Control.step`."""
        robot = self._robot
        if type(action) is not np.ndarray or action.shape != self._shape:
            action = checked_action(action, self._entries)
        try:
            self._action[...] = action
        except (TypeError, ValueError):
            self._action[:] = checked_action(action, self._entries)  # which says what is wrong
        if goal is not self._goal:
            self._goal = goal
            self._steps.aim(0, goal)
        if robot.events:
            checked_action(self._action, self._entries)
            robot.elongate_tendons()
        state = self._act() if self._noisy else self._run()
        if state == NOT_AN_ACTION:
            checked_action(self._action, self._entries)  # which says what is wrong
        if state == BROKEN:
            raise mujoco.FatalError(self._steps.reason(0))
        if state == DIVERGED:
            raise DivergedError
        if self._noisy:
            robot.random.standard_normal(out=self._noise)
            self._tell()
        told = self._told.copy()
        lengths, tensions, slack, beyond, angles, numbers = self._steps.parts
        error, tension, time, distance, touched = told[numbers].tolist()
        truth = {
            "joint_angles": told[angles],
            "hand_pose": self._pose.copy(),
            "slack_paid_out": told[slack],
            "slack_target": told[beyond],
            "time": time,
        }
        sight = None
        if self._thing is not None:
            sight = Sight(self._thing_pose.copy(), distance, int(touched))
        return {"lengths": told[lengths], "tensions": told[tensions]}, truth, error, tension, sight
