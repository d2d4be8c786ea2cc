"""Many robots stepped on all cores by compiled code: the bits of `Fleet`, in less time."""

from __future__ import annotations

import ctypes
import os
from copy import deepcopy

import mujoco
import numpy as np

from kengoro_env.robot.robot import Robot
from kengoro_env.spaces import LengthBounds
from kengoro_env.stepping.c_compiler import library
from kengoro_env.stepping.compiled_steps import BROKEN, DIVERGED, Steps
from kengoro_env.stepping.fleet import BatchResult, Fleet
from kengoro_env.types import Bools, Floats

SHARE = 4
"""For fewer robots another thread is not worth its start, unless it is asked for."""


def fleet_of(robot: Robot, bounds: LengthBounds, count: int, threads: int) -> Fleet | CompiledFleet:
    """Many robots, stepped by compiled code where that is possible; arguments as of `Fleet`."""
    compiled = library()
    if compiled is None:
        return Fleet(robot, bounds, count, threads)
    return CompiledFleet(robot, bounds, count, threads, compiled)


class CompiledFleet:
    """``count`` robots like ``robot``, which is the one that each of them begins as (`take`).

    Args:
        robot: drawing or actual robot; the fleet resets through it.
        bounds: of the wires' lengths, for actions and observations.
        count: how many.
        threads: how many threads step them, at most 256; 0: as many as pay, at most one a core.
        compiled: the code, of `library`.
    """

    def __init__(
        self,
        robot: Robot,
        bounds: LengthBounds,
        count: int,
        threads: int,
        compiled: ctypes.CDLL,
    ) -> None:
        self._robot = robot
        shared = None if robot.changing_fields else deepcopy(robot.model)
        self._robots = []
        for _ in range(count):
            model = deepcopy(robot.model) if shared is None else shared
            memo = {id(robot.model): model, id(robot.data): mujoco.MjData(model)}
            self._robots.append(deepcopy(robot, memo))  # its state comes with `take`
        self._steps = Steps(self._robots, bounds)
        self._goals = np.zeros((count, len(robot.joints)))
        for i, goal in enumerate(self._goals):
            self._steps.aim(i, goal)
        self._moving = np.zeros(count, dtype=np.uint8)
        self._states = np.zeros(count, dtype=np.int32)
        self._arguments = (
            self._steps.structures,
            ctypes.c_void_p(self._moving.ctypes.data),
            ctypes.c_void_p(self._states.ctypes.data),
            ctypes.c_int64(count),
            ctypes.c_int64(threads or min(cores(), max(1, count // SHARE))),
        )
        self._run = compiled.control_steps

    def take(self, i: int) -> None:
        """Let the ``i``-th robot be where ``robot`` is: to be called after each of its resets."""
        self._robots[i].become(self._robot)

    def step(self, actions: Floats, moving: Bools, goals: Floats) -> BatchResult:
        """Carry out actions for one control period; as `Fleet.step`.

        What is told are views of arrays that the next step writes.
        """
        steps = self._steps
        steps.actions[:, :-1], self._goals[:], self._moving[:] = actions, goals, moving
        noisy = bool(steps.noise.size)
        for robot, noise, moves in zip(self._robots, steps.noise, moving.tolist(), strict=True):
            if moves and robot.events:
                robot.elongate_tendons()
            if moves and noisy:
                robot.random.standard_normal(out=noise)
        self._run(*self._arguments)
        for i in np.flatnonzero(self._states == BROKEN):
            raise mujoco.FatalError(steps.reason(int(i)))
        lengths, tensions, slack, beyond, angles, numbers = (
            steps.told[:, part] for part in steps.parts
        )
        truth = {
            "joint_angles": angles,
            "hand_pose": steps.poses,
            "slack_paid_out": slack,
            "slack_target": beyond,
            "time": numbers[:, 2],
        }
        observation = {"lengths": lengths, "tensions": tensions}
        diverged = self._states == DIVERGED
        return BatchResult(diverged, observation, truth, numbers[:, 0], numbers[:, 1])

    def parts(self, i: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of the ``i``-th robot, for reading."""
        return self._robots[i].model, self._robots[i].data


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
