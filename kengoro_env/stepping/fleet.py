"""Many robots of one model, stepped on all cores by `mujoco.batch`, each as if it were alone.

For machines without a compiler; elsewhere compiled_fleet.py does the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco.batch import Batch

from kengoro_env.robot.body import Body
from kengoro_env.robot.draft import Event
from kengoro_env.robot.robot import DIVERGENCE, STATE, Robot
from kengoro_env.spaces import LengthBounds
from kengoro_env.stepping.observation import Observation, felt, known, mean
from kengoro_env.types import Bools, Floats


class BatchResult(NamedTuple):
    """What came of a control step of many robots; of those that moved and did not diverge.

    Attributes:
        diverged: which did (count,).
        observation: lengths and tensions (count, m).
        truth: entries of ``info``, with an axis of robots before theirs.
        errors: mean square error of the joint angles (count,) [rad^2].
        tensions: mean of the wires (count,) [N].
    """

    diverged: Bools
    observation: Observation
    truth: dict[str, Any]
    errors: Floats
    tensions: Floats


class Fleet(Body):
    """``count`` robots like ``robot``, which is the one that each of them begins as (`take`).

    Args:
        robot: drawing or actual robot; the fleet resets and reads through it.
        bounds: of the wires' lengths, for actions and observations.
        count: how many.
        threads: how many threads step them; 0: one a core.
    """

    muscles: tuple[str, ...]
    _substeps: int

    def __init__(self, robot: Robot, bounds: LengthBounds, count: int, threads: int = 0) -> None:
        vars(self).update(vars(robot))  # what they have in common
        self._robot, self._bounds = robot, bounds
        # Where friction follows tension, a call is one time step only. Then one `MjData` a thread,
        # which stays in its core's cache, is faster than one a robot; else it is slower.
        alone = not robot.motors.frictions
        self._batch = self.data = Batch(robot.model, count, threads, persistent=alone)
        for name in ("actuator_force", "ten_length", "ten_velocity", "site_xpos", "site_xmat"):
            self._batch.bind(name)  # what is bound later is zero until the next step
        self._look()
        fields = robot.changing_fields
        self._fields = SimpleNamespace(**{name: self._batch.expand(name) for name in fields})
        self.motors = robot.motors.of_many(count, self._fields, self._batch)
        self._target = np.zeros((count, len(robot.muscles)))
        self._random = [np.random.default_rng(0)] * count
        self._coming = [list(robot.events)] * count
        self._next = np.full(count, np.inf)  # when each one's next event is due
        self._state = np.empty(mujoco.mj_stateSize(robot.model, STATE))

    @property
    def time(self) -> Floats:
        """Simulated time since each one's last reset (count,) [s]."""
        return self._batch.bind("time").copy()

    def take(self, i: int) -> None:
        """Let the ``i``-th robot be where ``robot`` is: to be called after each of its resets."""
        robot, batch = self._robot, self._batch
        mujoco.mj_getState(robot.model, robot.data, self._state, STATE)
        for name, values in vars(self._fields).items():
            values[i] = getattr(robot.model, name)
        self.motors.elongate_one(i, robot.motors.elongation)
        batch.state[i], batch.warning[i] = self._state, 0
        batch.forward([i])
        self._target[i] = robot.target
        self._random[i], self._coming[i] = robot.random, list(robot.events)
        self._next[i] = _first_time(robot.events)

    def step(self, actions: Floats, moving: Bools, goals: Floats) -> BatchResult:
        """Carry out actions for one control period.

        Args:
            actions: (count, m), valid ones.
            moving: (count,) which robots go on; the others wait to be reset.
            goals: joint angles to reach (count, n) [rad].
        """
        diverged = self._move(self._bounds.to_lengths(actions), moving)
        now = self.measure()
        off = now.joint_angles - goals
        return BatchResult(
            diverged,
            felt(self, now, self._bounds),
            known(self, now) | {"time": self.time},
            mean(off * off),
            mean(now.tensions),
        )

    def _move(self, target: Floats, moving: Bools) -> Bools:
        """Hold target lengths (count, m) [m]; gives back which (count,) diverged."""
        batch, motors = self._batch, self.motors
        # Where each step is a call of its own, looking through the numbers of all takes its time.
        ids = None if moving.all() else np.flatnonzero(moving)
        for i in np.flatnonzero(moving & (self._next <= batch.bind("time"))):
            self._elongate_tendons(int(i))
        self._target[moving] = target[moving]
        motors.command(self._commanded(self._target))
        # Paths, poses and cameras follow the joints, which mj_step leaves a time step behind.
        stage = int(mujoco.mjtStage.mjSTAGE_POS)
        if motors.frictions:
            for _ in range(self._substeps - 1):
                motors.update_friction()
                batch.step(ids)
            motors.update_friction()
            batch.step(ids, stage=stage)
        else:
            batch.step(ids, self._substeps, stage)
        warned = batch.warning[:, DIVERGENCE, 1]  # (last info, number)
        velocity = batch.bind("qvel")
        finite = np.isfinite(np.vecdot(velocity, velocity))  # as `Robot` looks at its own
        return moving & (~finite | warned.any(axis=1))

    def parts(self, i: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of the ``i``-th robot, for reading."""
        return self._batch.get_model(i), self._batch.get_data(i)

    def _elongate_tendons(self, i: int) -> None:
        coming, now = self._coming[i], self._batch.bind("time")[i]
        while coming and coming[0].time <= now:
            event = coming.pop(0)
            elongation = self.motors.elongation[i]
            elongation[self.muscles.index(event.muscle)] += event.elongation
            self.motors.elongate_one(i, elongation)
        self._next[i] = _first_time(coming)

    def _noise(self, kinds: int) -> Floats:
        noise = np.empty((len(self._random), kinds, len(self.muscles)))
        for one, rows in zip(self._random, noise, strict=True):
            one.standard_normal(out=rows)
        return noise


def _first_time(events: Sequence[Event]) -> float:
    """When the first of some events is due [s]; infinite where there is none."""
    return events[0].time if events else np.inf
