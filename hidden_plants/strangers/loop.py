"""Simulation of a real machine in one episode."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from hidden_plants.strangers.drives import feedforward
from hidden_plants.strangers.plant import Plant, State
from hidden_plants.strangers.stranger import SETTLE, Stranger
from hidden_plants.types import Floats


@dataclass(frozen=True)
class Trace:
    """True signals of one episode.

    Attributes:
        time: (k,) [s] from the first command.
        encoder: encoder readings (k, drives).
        force: forces at their sensors (k, drives).
        position, velocity: of the joints (k, joints).
        sound: whether the simulation stayed finite.
    """

    time: Floats
    encoder: Floats
    force: Floats
    position: Floats
    velocity: Floats
    sound: bool


class Friction:
    """Dry friction by Dahl's model of bristles that bend, then slide, integrated in closed form."""

    def __init__(self, levels: Floats, load: Floats, travel: Floats, step: float) -> None:
        """Levels (k, 2) for both directions; load: share of the force (k,); travel (k,)."""
        self._up, self._down = levels.T
        self._same = bool(np.array_equal(self._up, self._down))
        self._load = load if load.any() else None
        self._rate = -step / travel
        self._force = np.zeros(len(levels))

    def __call__(self, velocity: Floats, force: Floats) -> Floats:
        """Friction (k,), positive where it opposes a positive velocity."""
        level = self._up if self._same else np.where(velocity > 0.0, self._up, self._down)
        if self._load is not None:
            level = level + self._load * np.abs(force)
        end = np.sign(velocity) * level
        self._force = end + (self._force - end) * np.exp(np.abs(velocity) * self._rate)
        return self._force


def simulate(plant: Plant, episode: int, time: Floats, command: Floats, start: float) -> Trace:
    """Let a machine settle under the first command, then perform an episode.

    Args:
        plant: the machine.
        episode: index of the planned path.
        time: of the commands (n,) [s], increasing from 0.
        command: (n, drives).
        start: log time at the begin of the episode [s].
    """
    model, step = plant.model, plant.step
    data = mujoco.MjData(model)
    data.qpos[:] = plant.stranger.paths[episode].home
    tendons = bool(plant.stranger.routes)
    count = len(plant.stranger.moved)
    state = State(
        data=data,
        position=data.ten_length if tendons else data.qpos,
        velocity=data.ten_velocity if tendons else data.qvel,
        encoder=np.zeros(count),
        force=np.zeros(count),
        pull=np.zeros(count),
        torque=np.zeros(model.nv),
        step=step,
        command=np.zeros(count),
    )
    act = _Actuation(plant, state)
    added, steady = _plan(plant, episode, time, command)
    settle = round(SETTLE / step)
    rows = len(added) - settle
    kept = [np.empty((rows, width)) for width in (count, count, model.nv, model.nv)]
    for k, drive in enumerate(added):
        state.time = start + max(0.0, (k - settle) * step)
        mujoco.mj_step1(model, data)
        act(drive, steady[k])
        if k >= settle:
            for table, row in zip(
                kept, (state.encoder, act.sensed, data.qpos, data.qvel), strict=True
            ):
                table[k - settle] = row
        mujoco.mj_step2(model, data)
        if not k % 512 and (data.warning.number.any() or not np.isfinite(data.qpos).all()):
            break
    sound = not data.warning.number.any() and all(np.isfinite(t).all() for t in kept)
    whole = bool(sound and k == len(added) - 1)
    return Trace(
        step * np.arange(rows, dtype=np.float64), kept[0], kept[1], kept[2], kept[3], whole
    )


def _plan(plant: Plant, episode: int, time: Floats, command: Floats) -> tuple[Floats, Floats]:
    """Commands and further forces of each physics step, settling included (steps, drives)."""
    stranger, step = plant.stranger, plant.step
    path = stranger.paths[episode]
    count = round((SETTLE + path.duration) / step) + 4
    begin = step * np.arange(count, dtype=np.float64) - SETTLE
    if stranger.traits.kind == "efforts":
        position, added = controlled(stranger, episode, begin + 0.5 * step)
        return position, added
    plan = mean_commands(begin, step, time, command, plant.delay)
    return plan, np.zeros_like(plan)


def controlled(stranger: Stranger, episode: int, time: Floats) -> tuple[Floats, Floats]:
    """Positions and added forces of the controller of a log of torques, each (k, joints)."""
    path = stranger.paths[episode]
    when, force = feedforward(stranger.model, path)
    position, speed, _ = path.motion(time)
    added = np.stack([np.interp(time, when, column) for column in force.T], axis=1)
    return position, added - stranger.law.rate * speed


def mean_commands(
    begin: Floats, step: float, time: Floats, command: Floats, delay: Floats
) -> Floats:
    """Mean of the commands, each of which holds until the next, in each step (k, drives).

    Args:
        begin: of the steps (k,) [s].
        step: length of the steps [s].
        time: of the commands (n,) [s].
        command: (n, drives).
        delay: of each drive (drives,) [s].
    """
    edges = np.append(begin, begin[-1] + step)
    knots = np.concatenate([[edges[0] - 1.0], time[1:], [edges[-1] + 1.0]])
    plan = np.empty((len(begin), command.shape[1]))
    for i, late in enumerate(delay):
        area = np.concatenate([[0.0], np.cumsum(command[:, i] * np.diff(knots))])
        plan[:, i] = np.diff(np.interp(edges - late, knots, area)) / step
    return plan


class _Actuation:
    """From positions and commands to the forces of one step; its devices belong to one episode."""

    def __init__(self, plant: Plant, state: State) -> None:
        self._plant, self._state = plant, state
        self._encoder = [make() for make in plant.encoder_devices]
        self._law = [make() for make in plant.law_devices]
        self._pull = [make() for make in plant.pull_devices]
        self._body = [make() for make in plant.body_devices]
        none = np.zeros(len(plant.scale))
        self._inner = Friction(plant.inner, none, plant.bristle, plant.step)
        self._outer = Friction(plant.outer, plant.load_friction, plant.bristle, plant.step)
        both = np.repeat(plant.joint_friction[:, None], 2, axis=1)
        joint = Friction(both, np.zeros(len(both)), plant.joint_bristle, plant.step)
        self._joint = joint if both.any() else None
        self._inner_acts = bool(plant.inner.any())
        self._keep = _keep(plant)
        self._lags = bool(plant.lag.any())
        self._level: Floats | None = None
        self.sensed = np.zeros(len(plant.scale))

    def __call__(self, command: Floats, added: Floats) -> None:
        """Write the forces of this step."""
        plant, state, law = self._plant, self._state, self._plant.law
        np.multiply(state.position, plant.scale, out=state.encoder)
        state.encoder += plant.offset
        for act in self._encoder:
            act(state)
        force = law.gain * command + law.bias + law.position * state.encoder + added
        force += law.rate * state.velocity
        if self._law:
            force = self._by_devices(command, force)
        force = np.minimum(np.maximum(force, law.low), law.high)
        if self._lags:
            self._level = force if self._level is None else self._level
            self._level = force + self._keep * (self._level - force)
            force = self._level
        state.force[:] = force
        state.force *= plant.force_scale
        state.force += plant.force_offset
        self.sensed[:] = state.force
        if self._inner_acts:
            self.sensed -= self._inner(state.velocity, state.force)
        state.pull[:] = self.sensed
        for act in self._pull:
            act(state)
        state.data.ctrl[:] = state.pull - self._outer(state.velocity, self.sensed)
        self._act_on_bodies()
        if plant.compensates:
            self.sensed += state.data.qfrc_gravcomp

    def _by_devices(self, command: Floats, force: Floats) -> Floats:
        """Let devices change the forces of the laws (drives,)."""
        kept = self._state.force.copy()
        self._state.command[:], self._state.force[:] = command, force
        for act in self._law:
            act(self._state)
        found, self._state.force[:] = self._state.force.copy(), kept
        return found

    def _act_on_bodies(self) -> None:
        state = self._state
        if not self._body and self._joint is None:
            return
        state.torque[:] = 0.0
        state.data.xfrc_applied[:] = 0.0
        for act in self._body:
            act(state)
        if self._joint is not None:
            state.torque -= self._joint(state.data.qvel, state.torque)
        state.data.qfrc_applied[:] = state.torque


def _keep(plant: Plant) -> Floats:
    """Share of a lagging force that remains after a step (drives,)."""
    found = np.zeros(len(plant.lag))
    late = plant.lag > 0.0
    found[late] = np.exp(-plant.step / plant.lag[late])
    return found
