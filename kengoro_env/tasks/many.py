"""Tasks of many environments at once, and the arrays of their results.

Reaching is judged by the steps themselves, on their threads. Can grasping is judged by
`CanGrasp.judge`, one environment after the other, from what the steps write of its can.
"""

from __future__ import annotations

from copy import copy

import numpy as np

from kengoro_env.stepping.report import Latest, latest_results, object_results, reach_results
from kengoro_env.stepping.tracked_object import ObjectState
from kengoro_env.tasks.can_grasp import CanGrasp
from kengoro_env.tasks.reach import Reach
from kengoro_env.tasks.task import Task
from kengoro_env.types import Bools


class ReachOfMany:
    """Reaching in many environments: steps judge it, and targets change here.

    Args:
        count: number of environments.
        muscles: number of muscles.
        joints: number of joints.

    Attributes:
        observed: names of the observations beside lengths and tensions.
        known: names of the entries of infos that only this task has.
        stepped: the results that steps write, or read; see `latest_results`, `reach_results`.
        latest: all results by name, with a leading axis of environments.
    """

    observed: tuple[str, ...] = ("target",)
    known: tuple[str, ...] = ()

    def __init__(self, count: int, muscles: int, joints: int) -> None:
        self.stepped = self.latest = latest_results(count, muscles, joints) | reach_results(
            count, joints
        )
        self._tasks: dict[int, Reach] = {}

    def begin(self, i: int, task: Task) -> None:
        """Environment ``i`` has begun an episode of ``task``, which is copied."""
        assert isinstance(task, Reach)
        self._tasks[i] = copy(task)
        self.latest["until"][i] = task.until

    def judge(self, moving: Bools, diverged: Bools) -> dict[int, str]:
        """Set the targets that are due.

        Args:
            moving: environments that have been stepped (count,).
            diverged: those of which the simulation is no longer finite (count,).

        Returns:
            Why episodes ended, by environment: none does.
        """
        latest = self.latest
        # The usual case costs no function of NumPy, see `KengoroVectorEnv.step`.
        if b"\1" in latest["due"].tobytes():
            for i in np.flatnonzero(latest["due"]).tolist():
                task = self._tasks[i]
                task.next_target()
                latest["target"][i], latest["until"][i] = task.goal, task.until
        return {}


class CanGraspOfMany:
    """Can grasping in many environments, see `ReachOfMany`."""

    observed: tuple[str, ...] = ()
    known: tuple[str, ...] = ("can_pose", "grasped", "rise")

    def __init__(self, count: int, muscles: int, joints: int) -> None:
        self.stepped = latest_results(count, muscles, joints) | object_results(count)
        judged: Latest = {
            "can_pose": np.tile(np.eye(4), (count, 1, 1)),
            **{name: np.zeros(count) for name in ("rise", "reward")},
            **{name: np.zeros(count, dtype=bool) for name in ("grasped", "success")},
        }
        self.latest = self.stepped | judged
        self._tasks: dict[int, CanGrasp] = {}

    def begin(self, i: int, task: Task) -> None:
        """Environment ``i`` has begun an episode of ``task``, which is copied."""
        assert isinstance(task, CanGrasp)
        self._tasks[i] = copy(task)

    def judge(self, moving: Bools, diverged: Bools) -> dict[int, str]:
        """Judge the environments that moved; see `ReachOfMany.judge`.

        Returns:
            Why episodes ended, by environment.
        """
        latest = self.latest
        latest["reward"][:], latest["success"][diverged] = 0.0, False
        names = ("error", "tension", "time", "distance", "touched")
        numbers = zip(*(latest[name].tolist() for name in names), strict=True)
        ended = {}
        for i, moved in enumerate((moving & ~diverged).tolist()):
            error, tension, time, distance, touched = next(numbers)
            if not moved:
                continue
            info = {"time": time}
            state = ObjectState(latest["object_pose"][i], distance, int(touched))
            latest["reward"][i], reason = self._tasks[i].judge(info, error, tension, state)
            for name in (*self.known, "success"):
                latest[name][i] = info[name]
            if reason is not None:
                ended[i] = reason
        return ended


TasksOfMany = ReachOfMany | CanGraspOfMany


def tasks_of_many(task: Task, count: int, muscles: int, joints: int) -> TasksOfMany:
    """The tasks of ``count`` environments with a task like ``task``."""
    kind = CanGraspOfMany if isinstance(task, CanGrasp) else ReachOfMany
    return kind(count, muscles, joints)
