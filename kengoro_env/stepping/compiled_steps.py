"""Control steps by compiled C code; the same bits as numpy_steps.py, in less time."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from copy import deepcopy
from functools import partial
from operator import attrgetter
from typing import Any
from weakref import finalize

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.errors import DivergedError
from kengoro_env.robot.robot import Robot
from kengoro_env.robot.robot_state import RobotState
from kengoro_env.spaces import LengthBounds, check_actions
from kengoro_env.stepping import reach_reward
from kengoro_env.stepping.report import Latest, Report
from kengoro_env.stepping.step_structures import Fleet, Step, fill
from kengoro_env.stepping.tracked_object import ObjectState, TrackedObject
from kengoro_env.types import Bools, Floats

DONE, INVALID, DIVERGED, BROKEN = range(4)
"""Outcomes of a step in control_step.c, from best to worst."""

NUMBERS = ("error", "tension", "time", "distance", "touched")
"""Results of a single robot that are one number."""

_events = attrgetter("events")
_new_report = partial(tuple.__new__, Report)  # a third of the time of Report(...)


class CompiledSteps:
    """Control steps of one robot, or of many robots of one model.

    Args:
        compiled: the compiled code, see `c_compiler.library`.
        robots: the robots; all have the same model.
        bounds: bounds of the lengths, for actions and observations.
        entries: names of the entries of an action: muscles, then "fingers" if they are commanded.
        tracked: the object that the hand of each robot is to lift; none: no object.
        latest: the results of many robots, to which steps write; None: a single robot.
        threads: number of threads that step the robots, at most 256.
    """

    def __init__(
        self,
        compiled: ctypes.CDLL,
        robots: Sequence[Robot],
        bounds: LengthBounds,
        entries: Sequence[str],
        tracked: Sequence[TrackedObject] = (),
        latest: Latest | None = None,
        threads: int = 1,
    ) -> None:
        self._robots, self._entries = robots, entries
        count, m, n = len(robots), len(robots[0].muscles), len(robots[0].joints)
        actions = np.full((count, m + 1), -1.0)  # -1 opens fingers that have no entry
        noise = np.zeros((count, m * robots[0].kinds_of_noise))
        self._object_pose = np.eye(4) if tracked else None
        objects = [each.layout() for each in tracked] or [{"object": -1}] * count
        results = self._rows_of_one(m, n) if latest is None else _rows_of_many(latest)
        self._structures = (Step * count)()
        self._kept: list[Any] = []  # the memory that pointers lead to
        for i, (structure, robot) in enumerate(zip(self._structures, robots, strict=True)):
            own = {"action": actions[i], "noise": noise[i], **results[i]}
            shown = {**robot.layout(), **bounds.layout(), **objects[i]}
            self._kept += fill(structure, {**shown, **own})
            for part, friction in zip(structure.friction, robot.motors.frictions, strict=False):
                self._kept += fill(part, friction.layout(robot.model))
        self._actions = actions[0 if latest is None else slice(None), : len(entries)]
        self._eventful = [each for each in robots if each.plans_events]
        self._none = np.zeros(count, dtype=bool)
        self._goals: Floats | None = None
        self._random: list[np.random.Generator | None] = [None] * count
        self._moving = np.ones(count, dtype=np.uint8)
        self._outcomes = np.zeros(count, dtype=np.int32)
        self._taken = np.zeros(count, dtype=np.uint8)
        self._fleet = Fleet(
            ctypes.addressof(self._structures),
            self._moving.ctypes.data,
            self._outcomes.ctypes.data,
            self._taken.ctypes.data,
            count,
            threads,
        )
        fleet = ctypes.byref(self._fleet)
        self._run = partial(compiled.control_steps, fleet)
        if threads > 1:
            finalize(self, compiled.end_fleet, fleet)

    def _rows_of_one(self, m: int, n: int) -> list[dict[str, Floats | None]]:
        """Results of a single robot, which `step` copies in one piece, by field of ``Step``."""
        sizes = dict.fromkeys(("lengths", "tensions", "slack_paid_out", "slack_target"), m)
        sizes |= {"joint_angles": n, **dict.fromkeys(NUMBERS, 1)}
        ends = np.cumsum([0, *sizes.values()]).tolist()
        parts = [*map(slice, ends, ends[1:])]
        self._report, self._pose = np.zeros(ends[-1]), np.eye(4)
        self._columns = (*parts[:5], slice(ends[5], None))
        rows = {name: self._report[part] for name, part in zip(sizes, parts, strict=True)}
        return [{**rows, "hand_pose": self._pose, "object_pose": self._object_pose}]

    def step(self, actions: NDArray[np.floating[Any]], goals: Floats | None) -> Report:
        """Carry out an action of a single robot for one control period.

        Args:
            actions: an entry per entry name (k,).
            goals: joint angles to reach (n,) [rad], an array that is not written to; None: no goal.

        Raises:
            InvalidActionError: an entry is not in [-1, 1]; the robot has not moved.
            DivergedError: the state of the simulation is no longer finite.
            mujoco.FatalError: MuJoCo raised an error.
        """
        self._actions[...] = actions
        robot = self._robots[0]
        if robot.events:
            self._apply_events()
        if robot.random is not self._random[0]:
            self._use_generator(0)
        if goals is not self._goals:
            self._goals = goals
            self._structures[0].goal = None if goals is None else goals.ctypes.data
        if self._advance() == DIVERGED:
            raise DivergedError
        values = self._report.copy()
        lengths, tensions, slack, beyond, angles, numbers = self._columns
        error, tension, time, distance, touched = values[numbers].tolist()
        truth = {
            "joint_angles": values[angles],
            "hand_pose": self._pose.copy(),
            "slack_paid_out": values[slack],
            "slack_target": values[beyond],
            "time": time,
        }
        state = None
        if self._object_pose is not None:
            state = ObjectState(self._object_pose.copy(), distance, int(touched))
        observation = {"lengths": values[lengths], "tensions": values[tensions]}
        return _new_report((observation, truth, error, tension, state))

    def step_many(self, actions: NDArray[np.floating[Any]], moving: Bools) -> Bools:
        """Carry out actions of many robots for one control period, and write the latest results.

        Args:
            actions: an entry per entry name (count, k).
            moving: which robots move (count,).

        Returns:
            Which robots diverged: their state is no longer finite (count,).

        Raises:
            InvalidActionError: an entry is not in [-1, 1]; no robot has moved.
            mujoco.FatalError: MuJoCo raised an error.
        """
        self._actions[...], self._moving[:] = actions, moving
        if any(map(_events, self._eventful)):
            self._apply_events()
        if self._advance() == DIVERGED:
            return self._outcomes == DIVERGED
        return self._none.copy()

    def _advance(self) -> int:
        """Step the robots; return the worst outcome."""
        worst: int = self._run()
        if worst == BROKEN:
            first = int(np.flatnonzero(self._outcomes == BROKEN)[0])
            raise mujoco.FatalError(self._structures[first].reason.decode(errors="replace"))
        if worst == INVALID:
            check_actions(self._actions, self._entries)
        return worst

    def restore(self, i: int, state: RobotState) -> None:
        """Continue robot ``i`` of many from a state."""
        self._robots[i].restore(state)
        self._use_generator(i)

    def state(self, i: int) -> RobotState:
        """The present state of robot ``i`` of many."""
        return self._robots[i].state()

    def parts(self, i: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of robot ``i``, to read from."""
        return self._robots[i].model, self._robots[i].data

    def _apply_events(self) -> None:
        """Apply the events that are due, if the actions are valid."""
        check_actions(self._actions, self._entries)
        for robot, moves in zip(self._robots, self._moving.tolist(), strict=True):
            if moves:
                robot.elongate_tendons()

    def _use_generator(self, i: int) -> None:
        """Sample the noise of the sensors of robot ``i`` by its present generator."""
        self._random[i] = random = self._robots[i].random
        self._structures[i].random = random.bit_generator.ctypes.bit_generator


def _rows_of_many(latest: Latest) -> list[dict[str, Any]]:
    """Results of each robot by field of ``Step``; with goals, the constants of the reward, too."""
    rows = {name: values.reshape(len(values), -1) for name, values in latest.items()}
    constants = {}
    if "target" in rows:
        rows["goal"], constants = rows.pop("target"), reach_reward.layout()
    return [
        {**{name: values[i] for name, values in rows.items()}, **constants}
        for i in range(len(rows["time"]))
    ]


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
