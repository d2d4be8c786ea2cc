"""Control steps by compiled C code; the same bits as numpy_steps.py, in less time."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from copy import deepcopy
from functools import partial
from operator import attrgetter
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.errors import DivergedError
from kengoro_env.robot.robot import Robot
from kengoro_env.robot.robot_state import RobotState
from kengoro_env.spaces import LengthBounds, check_actions
from kengoro_env.stepping.report import Report
from kengoro_env.stepping.step_structures import Fleet, Step, fill
from kengoro_env.stepping.tracked_object import ObjectState, TrackedObject
from kengoro_env.types import Bools, Floats

DONE, INVALID, DIVERGED, BROKEN = range(4)
"""Outcomes of a step in control_step.c, from best to worst."""

_events = attrgetter("events")
_new_report = partial(tuple.__new__, Report)  # a third of the time of Report(...)


class CompiledSteps:
    """Control steps of one robot, or of many robots of one model.

    A single robot is a fleet of one: its rows of the fleet's arrays are used without the axis of
    robots.

    Args:
        compiled: the compiled code, see `c_compiler.library`.
        robots: the robots; all have the same model.
        bounds: bounds of the lengths, for actions and observations.
        entries: names of the entries of an action: muscles, then "fingers" if they are commanded.
        tracked: the object that the hand of a single robot is to lift.
        single: whether rows have no axis of robots.
        threads: number of threads that step the robots, at most 256.
    """

    def __init__(
        self,
        compiled: ctypes.CDLL,
        robots: Sequence[Robot],
        bounds: LengthBounds,
        entries: Sequence[str],
        tracked: TrackedObject | None = None,
        single: bool = True,
        threads: int = 1,
    ) -> None:
        self._robots, self._entries, self._single = robots, entries, single
        count, m, n = len(robots), len(robots[0].muscles), len(robots[0].joints)
        actions = np.full((count, m + 1), -1.0)  # -1 opens fingers that have no entry
        self._noisy = robots[0].kinds_of_noise > 0
        self._noise = list(np.zeros((count, m * robots[0].kinds_of_noise)))
        ends = (*range(0, 4 * m + 1, m), 4 * m + n, 4 * m + n + 5)
        parts = tuple(map(slice, ends, ends[1:]))
        reports, poses = np.zeros((count, ends[-1])), np.tile(np.eye(4), (count, 1, 1))
        self._object_pose = None if tracked is None else np.eye(4)
        tracking = {"object": -1} if tracked is None else tracked.layout()
        shared = {**bounds.layout(), **tracking, "object_pose": self._object_pose}
        self._structures = (Step * count)()
        self._kept: list[Any] = []  # the memory that pointers lead to
        for i, (structure, robot) in enumerate(zip(self._structures, robots, strict=True)):
            own = {"action": actions[i], "noise": self._noise[i]}
            own |= {"report": reports[i], "pose": poses[i]}
            self._kept += fill(structure, {**robot.layout(), **shared, **own})
            for part, friction in zip(structure.friction, robot.motors.frictions, strict=False):
                self._kept += fill(part, friction.layout(robot.model))
        rows = 0 if self._single else slice(None)
        self._actions = actions[rows, : len(entries)]
        self._report, self._poses = reports[rows], poses[rows]
        self._columns = [columns if self._single else (rows, columns) for columns in parts]
        self._goals: Floats | None = None
        self._moving = np.ones(count, dtype=np.uint8)
        self._outcomes = np.zeros(count, dtype=np.int32)
        self._fleet = Fleet(
            ctypes.addressof(self._structures),
            self._moving.ctypes.data,
            self._outcomes.ctypes.data,
            count,
            threads,
            not self._noisy,  # else after the noise has been sampled
        )
        self._run = partial(compiled.control_steps, ctypes.byref(self._fleet))
        self._write_reports = partial(compiled.write_reports, ctypes.byref(self._fleet))

    def step(
        self,
        actions: NDArray[np.floating[Any]],
        goals: Floats | None,
        moving: Bools | None = None,
    ) -> Report:
        """Carry out actions for one control period.

        Args:
            actions: an entry per entry name, (k,) or (count, k).
            goals: joint angles to reach, (n,) or (count, n) [rad], an array that stays in use;
                None: no goal.
            moving: which of many robots move (count,); None: all.

        Raises:
            InvalidActionError: an entry is not in [-1, 1]; that robot has not moved.
            DivergedError: the state of a single robot is no longer finite; see `Report.diverged`.
            mujoco.FatalError: MuJoCo raised an error.
        """
        self._actions[...] = actions
        if moving is not None:
            self._moving[:] = moving
        if goals is not self._goals:
            self._aim(goals)
        robots = self._robots
        if robots[0].events if self._single else any(map(_events, robots)):
            self._apply_events()
        worst = self._run()
        if worst:
            self._raise(worst)
        if self._noisy:
            self._sample_noise()
            self._write_reports()
        values = self._report.copy()
        lengths, tensions, slack, beyond, angles, numbers = self._columns
        last: Any = values[numbers]
        error, tension, time, distance, touched = last.tolist() if self._single else last.T
        truth = {
            "joint_angles": values[angles],
            "hand_pose": self._poses.copy(),
            "slack_paid_out": values[slack],
            "slack_target": values[beyond],
            "time": time,
        }
        state = None
        if self._object_pose is not None:
            state = ObjectState(self._object_pose.copy(), distance, int(touched))
        observation = {"lengths": values[lengths], "tensions": values[tensions]}
        diverged = False if self._single else self._outcomes == DIVERGED
        return _new_report((observation, truth, error, tension, state, diverged))

    def restore(self, i: int, state: RobotState) -> None:
        """Continue robot ``i`` of many from a state."""
        self._robots[i].restore(state)

    def state(self, i: int) -> RobotState:
        """The present state of robot ``i`` of many."""
        return self._robots[i].state()

    def parts(self, i: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of robot ``i``, to read from."""
        return self._robots[i].model, self._robots[i].data

    def _aim(self, goals: Floats | None) -> None:
        """Point the structures to the goals of the robots."""
        self._goals = goals
        for i, structure in enumerate(self._structures):
            structure.goal = None if goals is None else np.atleast_2d(goals)[i].ctypes.data

    def _apply_events(self) -> None:
        """Apply the events that are due, if the actions are valid."""
        check_actions(self._actions, self._entries)
        for robot, moves in zip(self._robots, self._moving.tolist(), strict=True):
            if moves:
                robot.elongate_tendons()

    def _sample_noise(self) -> None:
        """Sample the noise of the sensors of robots that moved."""
        if self._single:
            self._robots[0].random.standard_normal(out=self._noise[0])
            return
        moved = (self._moving.astype(bool) & (self._outcomes == DONE)).tolist()
        for robot, noise, moves in zip(self._robots, self._noise, moved, strict=True):
            if moves:
                robot.random.standard_normal(out=noise)

    def _raise(self, worst: int) -> None:
        """Raise the error of a step that did not succeed in all robots."""
        if worst == BROKEN:
            first = int(np.flatnonzero(self._outcomes == BROKEN)[0])
            raise mujoco.FatalError(self._structures[first].reason.decode(errors="replace"))
        if INVALID in self._outcomes:
            check_actions(self._actions, self._entries)
        if self._single:
            raise DivergedError


def copies(robot: Robot, count: int) -> list[Robot]:
    """Robots like ``robot``, whose states are set by `CompiledSteps.restore`.

    They share one model if a simulation does not change it.
    """
    shared = None if robot.changing_fields else deepcopy(robot.model)
    robots = []
    for _ in range(count):
        model = deepcopy(robot.model) if shared is None else shared
        memo = {id(robot.model): model, id(robot.data): mujoco.MjData(model)}
        robots.append(deepcopy(robot, memo))
    return robots
