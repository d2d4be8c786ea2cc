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
from kengoro_env.stepping.report import Report, measured_report
from kengoro_env.stepping.tracked_object import TrackedObject
from kengoro_env.types import Bools, Floats


class NumpySteps:
    """Control steps of one robot, or of many robots of one model.

    Args:
        robots: a robot, whose arrays have no axis of robots; or many, in a leading axis.
        bounds: bounds of the lengths, for actions and observations.
        entries: names of the entries of an action: muscles, then "fingers" if they are commanded.
        tracked: the object that the hand of a single robot is to lift.
    """

    def __init__(
        self,
        robots: Robot | RobotBatch,
        bounds: LengthBounds,
        entries: Sequence[str],
        tracked: TrackedObject | None = None,
    ) -> None:
        self._robots, self._bounds, self._entries = robots, bounds, entries
        self._tracked = tracked

    def step(
        self,
        actions: NDArray[np.floating[Any]],
        goals: Floats | None,
        moving: Bools | None = None,
    ) -> Report:
        """Carry out actions for one control period; see `CompiledSteps.step`."""
        check_actions(actions, self._entries)
        robots, count = self._robots, len(self._robots.muscles)
        clipped: Floats = np.clip(actions.astype(float), -1.0, 1.0)
        target = self._bounds.to_lengths(clipped[..., :count])
        if isinstance(robots, Robot):
            robots.close_fingers(float(clipped[-1]) if len(clipped) > count else -1.0)
            robots.step(target)
            return measured_report(robots, self._bounds, goals, self._tracked)
        assert moving is not None
        diverged = robots.step(target, moving)
        return measured_report(robots, self._bounds, goals, diverged=diverged)

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
