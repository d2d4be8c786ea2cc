"""Control steps by NumPy, for machines without a C compiler; the same bits as compiled_steps.py."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.robot.robot import Robot
from kengoro_env.robot.robot_batch import RobotBatch
from kengoro_env.robot.robot_state import RobotState
from kengoro_env.spaces import LengthBounds, check_actions
from kengoro_env.stepping.reach_reward import judged
from kengoro_env.stepping.report import Latest, Report, measured_report
from kengoro_env.stepping.tracked_object import TrackedObject
from kengoro_env.types import Bools, Floats


class NumpySteps:
    """Control steps of one robot, or of many robots of one model.

    Args:
        robots: a robot, whose arrays have no axis of robots; or many, in a leading axis.
        bounds: bounds of the lengths, for actions and observations.
        entries: names of the entries of an action: muscles, then "fingers" if they are commanded.
        tracked: the object that the hand is to lift, alike in all robots; None: no object.
        latest: the results of many robots, to which steps write; None: a single robot.
    """

    def __init__(
        self,
        robots: Robot | RobotBatch,
        bounds: LengthBounds,
        entries: Sequence[str],
        tracked: TrackedObject | None = None,
        latest: Latest | None = None,
    ) -> None:
        self._robots, self._bounds, self._entries = robots, bounds, entries
        self._tracked, self._latest = tracked, latest

    def step(self, actions: NDArray[np.floating[Any]], goals: Floats | None) -> Report:
        """Carry out an action for one control period; see `CompiledSteps.step`."""
        robot = self._robots
        assert isinstance(robot, Robot)
        clipped = self._clipped(actions)
        count = len(robot.muscles)
        robot.close_fingers(float(clipped[-1]) if len(clipped) > count else -1.0)
        robot.step(self._bounds.to_lengths(clipped[:count]))
        return measured_report(robot, self._bounds, goals, self._tracked)

    def step_many(self, actions: NDArray[np.floating[Any]], moving: Bools) -> Bools:
        """Carry out actions for one control period; see `CompiledSteps.step_many`."""
        robots, latest = self._robots, self._latest
        assert isinstance(robots, RobotBatch)
        assert latest is not None
        clipped = self._clipped(actions)
        count = len(robots.muscles)
        if clipped.shape[1] > count:
            robots.close_fingers(clipped[:, -1], moving)
        diverged = robots.step(self._bounds.to_lengths(clipped[:, :count]), moving)
        report = measured_report(robots, self._bounds, latest.get("target"))
        moved = moving & ~diverged
        for name, values in (report.observation | report.truth).items():
            latest[name][moved] = values[moved]
        latest["tension"][moved] = report.tension[moved]
        if "target" in latest:
            self._judge(report, moved)
        if self._tracked is not None:
            for i in np.flatnonzero(moved):
                state = self._tracked.observe(robots.data_of(int(i)))
                latest["object_pose"][i] = state.pose
                latest["distance"][i], latest["touched"][i] = state.distance, state.touched
        return diverged

    def _judge(self, report: Report, moved: Bools) -> None:
        """Write reward and success of robots that reach, and whether their next target is due."""
        latest = self._latest
        assert latest is not None
        latest["error"][moved] = report.error[moved]
        outcomes = map(judged, report.error.tolist(), report.tension.tolist())
        rewards, successes = map(np.array, zip(*outcomes, strict=True))
        latest["reward"][:], latest["success"][:] = np.where(moved, rewards, 0.0), moved & successes
        latest["due"][:] = moved & (latest["time"] >= latest["until"])

    def _clipped(self, actions: NDArray[np.floating[Any]]) -> Floats:
        check_actions(actions, self._entries)
        clipped: Floats = np.clip(actions.astype(float), -1.0, 1.0)
        return clipped

    def restore(self, i: int, state: RobotState) -> None:
        """Continue robot ``i`` of many from a state."""
        assert isinstance(self._robots, RobotBatch)
        self._robots.restore(i, state)

    def state(self, i: int) -> RobotState:
        """The present state of robot ``i`` of many."""
        assert isinstance(self._robots, RobotBatch)
        return self._robots.state(i)

    def parts(self, i: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of robot ``i``, to read from."""
        robots = self._robots
        return (robots.model, robots.data) if isinstance(robots, Robot) else robots.parts(i)
