"""Many robots of one model, stepped by `mujoco.batch`: each computes the bits of a `Robot`."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch

from kengoro_env.robot.body import Body
from kengoro_env.robot.draft import Event
from kengoro_env.robot.robot import DIVERGENCE, Robot
from kengoro_env.robot.robot_state import RobotState
from kengoro_env.types import Bools, Floats

_BOUND = ("actuator_force", "ten_length", "ten_velocity", "site_xpos", "site_xmat")
"""Fields of `MjData` that are read after each step; one bound later is zero until the next step."""


class _Data:
    """Arrays of a batch; the actuators' forces are a copy, which a restored state may set.

    Args:
        batch: the batch.
        forces: forces of the actuators (count, nu) [N, N m].
    """

    def __init__(self, batch: Batch, forces: Floats) -> None:
        self._batch, self.actuator_force = batch, forces

    def __getattr__(self, name: str) -> Any:
        return getattr(self._batch, name)


class RobotBatch(Body):
    """``count`` robots like ``robot``.

    The robots start undefined: `restore` sets the state of each.

    Args:
        robot: the template.
        count: number of robots.
        threads: number of threads that step them; 0: one per core.
        keeps_data: whether `data_of` is to return what steps have computed, such as contacts.
    """

    _substeps: int
    _fingers: int | None

    def __init__(
        self, robot: Robot, count: int, threads: int = 0, keeps_data: bool = False
    ) -> None:
        vars(self).update(vars(robot))  # names, sensors and sizes, which all robots share
        # Friction that follows tension needs one call per time step. Then one `MjData` a thread,
        # which stays in the cache of its core, is faster than one a robot; otherwise it is slower.
        persistent = keeps_data or not robot.motors.frictions
        self._batch = self.data = Batch(robot.model, count, threads, persistent=persistent)
        for name in _BOUND:
            self._batch.bind(name)
        self._find_arrays()
        fields = robot.changing_fields
        self._fields = SimpleNamespace(**{name: self._batch.expand(name) for name in fields})
        self._forces = np.zeros((count, robot.model.nu))
        data = _Data(self._batch, self._forces)
        self.motors = robot.motors.of_many(count, self._fields, data)
        self._target = np.zeros((count, len(robot.muscles)))
        self._random = [np.random.default_rng(0)] * count
        self._events = [list(robot.events)] * count
        self._next_event = np.full(count, np.inf)  # time of each robot's next event [s]
        self._copied = mujoco.MjData(robot.model) if keeps_data else None

    @property
    def time(self) -> Floats:
        """Simulated time since each robot's last reset (count,) [s]."""
        return self._batch.bind("time").copy()

    def restore(self, i: int, state: RobotState) -> None:
        """Continue robot ``i`` from a state, and share its generator."""
        batch = self._batch
        for name, values in state.fields.items():
            getattr(self._fields, name)[i] = values
        self.motors.elongate_one(i, state.elongation)
        batch.state[i], batch.warning[i] = state.physics, 0
        batch.forward([i])
        self._forces[i], self._target[i] = state.forces, state.target
        self._random[i], self._events[i] = state.random, list(state.events)
        self._next_event[i] = _first_time(state.events)

    def state(self, i: int) -> RobotState:
        """The present state of robot ``i``; it shares the generator of the noise with it."""
        return RobotState(
            self._batch.state[i].copy(),
            self._forces[i].copy(),
            {name: values[i].copy() for name, values in vars(self._fields).items()},
            self.motors.elongation[i],
            self._target[i].copy(),
            self._random[i],
            list(self._events[i]),
        )

    def step(self, target: Floats, moving: Bools) -> Bools:
        """Hold target lengths by muscle stiffness control for one control period.

        Args:
            target: target lengths (count, m) [m].
            moving: which robots move (count,).

        Returns:
            Which robots diverged (count,).
        """
        batch, motors = self._batch, self.motors
        # With many short calls, the check of all indices costs time that None saves.
        ids = None if moving.all() else np.flatnonzero(moving)
        for i in np.flatnonzero(moving & (self._next_event <= batch.bind("time"))):
            self._elongate_tendons(int(i))
        self._target[moving] = target[moving]
        motors.command(self._commanded(self._target))
        # Paths, poses and cameras follow the joints; mj_step alone leaves them a time step behind.
        stage = int(mujoco.mjtStage.mjSTAGE_POS)
        if motors.frictions:
            for _ in range(self._substeps - 1):
                motors.update_friction()
                batch.step(ids)
                self._forces[:] = batch.bind("actuator_force")
            motors.update_friction()
            batch.step(ids, stage=stage)
        else:
            batch.step(ids, self._substeps, stage)
        self._forces[:] = batch.bind("actuator_force")
        warned = batch.warning[:, DIVERGENCE, 1]  # (last info, number)
        velocity = batch.bind("qvel")
        finite = np.isfinite(np.vecdot(velocity, velocity))  # as in `Robot`
        return moving & (~finite | warned.any(axis=1))

    def close_fingers(self, commands: Floats, moving: Bools) -> None:
        """Command the fingers of robots that move, from -1 (open) to +1 (closed) (count,)."""
        assert self._fingers is not None
        self._batch.ctrl[moving, self._fingers] = commands[moving]

    def data_of(self, i: int) -> mujoco.MjData:
        """What the last step of robot ``i`` computed, until the next call."""
        assert self._copied is not None
        return self._batch.get_data(i, self._copied)

    def parts(self, i: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of robot ``i``, to read from."""
        return self._batch.get_model(i), self._batch.get_data(i)

    def _elongate_tendons(self, i: int) -> None:
        events, now = self._events[i], self._batch.bind("time")[i]
        while events and events[0].time <= now:
            event = events.pop(0)
            elongation = self.motors.elongation[i]
            elongation[self.muscles.index(event.muscle)] += event.elongation
            self.motors.elongate_one(i, elongation)
        self._next_event[i] = _first_time(events)

    def _noise(self, kinds: int) -> Floats:
        noise = np.empty((len(self._random), kinds, len(self.muscles)))
        for random, rows in zip(self._random, noise, strict=True):
            random.standard_normal(out=rows)
        return noise


def _first_time(events: Sequence[Event]) -> float:
    """Time of the first event [s]; infinite without events."""
    return events[0].time if events else np.inf
