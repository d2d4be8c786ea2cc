"""Choice of the implementation of control steps: compiled code where possible, else NumPy."""

from __future__ import annotations

import os
from collections.abc import Sequence

from kengoro_env.errors import ArgumentError
from kengoro_env.robot.robot import Robot
from kengoro_env.robot.robot_batch import RobotBatch
from kengoro_env.spaces import LengthBounds
from kengoro_env.stepping.c_compiler import library
from kengoro_env.stepping.compiled_steps import CompiledSteps, copies
from kengoro_env.stepping.numpy_steps import NumpySteps
from kengoro_env.stepping.report import Latest
from kengoro_env.stepping.tracked_object import TrackedObject

Steps = CompiledSteps | NumpySteps

MOST_THREADS = 256
"""Largest number of threads."""

LEAST_WORK = 80
"""A further thread pays only for this much `work` or more: two steps of the nominal elbow."""


def steps_of_one(
    robot: Robot, bounds: LengthBounds, entries: Sequence[str], tracked: TrackedObject | None
) -> Steps:
    """Control steps of ``robot`` itself.

    Args:
        robot: the robot.
        bounds: bounds of the lengths, for actions and observations.
        entries: names of the entries of an action.
        tracked: the object that the hand is to lift; None: no object.
    """
    compiled = library()
    if compiled is None:
        return NumpySteps(robot, bounds, entries, tracked)
    return CompiledSteps(compiled, [robot], bounds, entries, [] if tracked is None else [tracked])


def steps_of_many(
    templates: Sequence[Robot],
    bounds: LengthBounds,
    entries: Sequence[str],
    latest: Latest,
    threads: int,
    object_name: str | None = None,
) -> Steps:
    """Control steps of copies of a robot, or of one each, whose states `restore` sets.

    Args:
        templates: one robot, or one for each row of ``latest``, with the same muscles and joints.
        bounds: bounds of the lengths, for actions and observations.
        entries: names of the entries of an action.
        latest: the results, to which steps write.
        threads: number of threads, at most `MOST_THREADS`; 0: as many as pay, at most one per core.
        object_name: name of the object that each hand is to lift; None: no object.

    Raises:
        ArgumentError: there are several robots, and no compiled code to step them.
    """
    compiled, robot, count = library(), templates[0], len(latest["time"])
    tracked = []
    if object_name is not None:
        tracked = [TrackedObject(each.model, object_name) for each in templates]
    if compiled is None:
        if len(templates) > 1:
            raise ArgumentError(
                "models for each environment need a C compiler; without one, make a "
                "gymnasium.vector.SyncVectorEnv of environments with a model each"
            )
        batch = RobotBatch(robot, count, threads, keeps_data=bool(tracked))
        return NumpySteps(batch, bounds, entries, next(iter(tracked), None), latest)
    threads = threads or threads_for(robot, count)
    if len(templates) == 1:
        robots, tracked = copies(robot, count), tracked * count
    else:
        robots = [copies(each, 1)[0] for each in templates]
    return CompiledSteps(compiled, robots, bounds, entries, tracked, latest, threads)


def threads_for(robot: Robot, count: int) -> int:
    """Number of threads that pay for a step of ``count`` robots, at most one per core and robot."""
    return min(cores(), count, max(1, count * work(robot) // LEAST_WORK), MOST_THREADS)


def work(robot: Robot) -> int:
    """Estimate of the work of a control step: degrees of freedom and tendons, times time steps."""
    model = robot.model
    substeps = round(robot.control_period / model.opt.timestep)
    return substeps * (int(model.nv) + int(model.ntendon))


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
