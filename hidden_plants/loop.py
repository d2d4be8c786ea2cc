"""Simulation of one episode: motor law, devices and friction at each physics step."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from hidden_plants.robot import Robot, State
from hidden_plants.types import Floats

SETTLE = 1.0
"""Time for which the first command is held before an episode begins [s]."""
BRISTLE = 2e-5
"""Travel over which the dry friction of a tendon builds up [m]."""
STRIDE = 2
"""Physics steps between two stored samples."""


@dataclass(frozen=True)
class Task:
    """Commands of one episode.

    Attributes:
        time: of the commands (n,) [s], increasing from 0; each command holds until the next.
        command: target lengths (n, tendons) [m].
        initial: joint positions at the start of the settling time (joints,) [rad].
        duration: of the episode [s].
        start: of the episode in log time, episodes end to end [s].
    """

    time: Floats
    command: Floats
    initial: Floats
    duration: float
    start: float


@dataclass(frozen=True)
class Trace:
    """True signals of one episode on a uniform grid.

    Attributes:
        time: (k,) [s], increasing from 0.
        encoder: encoder readings without noise (k, tendons) [m].
        tension: at the motors (k, tendons) [N].
        qpos: joint positions (k, joints) [rad].
    """

    time: Floats
    encoder: Floats
    tension: Floats
    qpos: Floats


def run_task(robot: Robot, task: Task) -> Trace:
    """Let the robot settle under the first command, then perform the task."""
    state = _initial_state(robot, task)
    actuation = Actuation(robot, state)
    model, data, step = robot.model, state.data, robot.step
    encoder, motor, qpos = state.encoder, state.motor, data.qpos
    settle, stored = round(SETTLE / step), []
    for k, target in enumerate(_plan(robot, task)):
        state.time = (k - settle) * step
        state.log_time = task.start + max(0.0, state.time)
        mujoco.mj_step1(model, data)
        actuation(target)
        if k >= settle and not (k - settle) % STRIDE:
            stored.append(np.concatenate((encoder, motor, qpos)))
        mujoco.mj_step2(model, data)
    count = len(robot.machine.tendons)
    time = STRIDE * step * np.arange(len(stored), dtype=np.float64)
    return Trace(time, *np.split(np.array(stored), [count, 2 * count], axis=1))


def _initial_state(robot: Robot, task: Task) -> State:
    data = mujoco.MjData(robot.model)
    data.qpos[:] = task.initial
    count = len(robot.machine.tendons)
    return State(
        model=robot.model,
        data=data,
        length=data.ten_length,
        velocity=data.ten_velocity,
        encoder=np.empty(count),
        motor=np.full(count, robot.bias),
        pull=np.empty(count),
        step=robot.step,
    )


def _plan(robot: Robot, task: Task) -> Floats:
    """Target lengths of every physics step, settling time included (steps, tendons) [m].

    Each step takes the mean of the command over an interval of one step around it, so that the
    instant of a command is not rounded to a step. The plan is a few steps longer than the duration,
    so that the last sample lies inside it.
    """
    step = robot.step
    steps = round((SETTLE + task.duration) / step) + 2 * STRIDE
    edges = (np.arange(steps + 1) - 0.5) * step - SETTLE
    end = edges[-1] + 1.0
    knots = np.concatenate([[edges[0] - 1.0], task.time[1:], [end]])
    plan = np.empty((steps, task.command.shape[1]))
    for tendon, (targets, delay) in enumerate(
        zip(task.command.T, robot.command_delay, strict=True)
    ):
        area = np.concatenate([[0.0], np.cumsum(targets * np.diff(knots))])
        plan[:, tendon] = np.diff(np.interp(edges - delay, knots, area)) / step
    return plan


class Actuation:
    """From tendon lengths and targets to the forces of one physics step, in this order:

    1. The encoders read scaled and shifted lengths; encoder devices change the readings.
    2. The motor law gives the tension clip(bias + stiffness (reading - target), bias, cut); motor
       devices change it, then gain and offset are applied.
    3. Pull devices change the tension at the bone; dry friction is added.
    4. Body devices apply further forces and torques.

    An instance belongs to one episode, because devices have states.
    """

    def __init__(self, robot: Robot, state: State) -> None:
        self._robot, self._state = robot, state
        self._control = state.data.ctrl
        self._applied, self._pushed = state.data.qfrc_applied, state.data.xfrc_applied
        machine = robot.machine
        zero = machine.lengths(machine.model.qpos0)[0] + robot.offset
        self._offset = zero - robot.scale * robot.zero_lengths()
        self._encoder_devices = [make() for make in robot.encoder_devices]
        self._motor_devices = [make() for make in robot.motor_devices]
        self._pull_devices = [make() for make in robot.pull_devices]
        self._body_devices = [make() for make in robot.body_devices]
        self._friction = TendonFriction(robot)

    def __call__(self, target: Floats) -> None:
        """Write the forces of this step; ``target``: lengths (tendons,) [m]."""
        robot, state = self._robot, self._state
        encoder, motor, pull = state.encoder, state.motor, state.pull
        np.multiply(state.length, robot.scale, out=encoder)
        encoder += self._offset
        for act in self._encoder_devices:
            act(state)
        np.subtract(encoder, target, out=motor)
        motor *= robot.stiffness
        motor += robot.bias
        np.maximum(motor, robot.bias, out=motor)
        np.minimum(motor, robot.cut, out=motor)
        for act in self._motor_devices:
            act(state)
        motor *= robot.gain
        motor += robot.force_offset
        pull[:] = motor
        for act in self._pull_devices:
            act(state)
        np.add(pull, self._friction(state), out=self._control)
        if self._body_devices:
            self._applied[:] = 0.0
            self._pushed[:] = 0.0
        for act in self._body_devices:
            act(state)


class TendonFriction:
    """Dry friction of all tendons: Dahl's model of bristles that bend over `BRISTLE`, then slide.

    The level of sliding friction depends on the direction of motion, plus a share of the tension as
    in a capstan. The bending is integrated in closed form over a step of constant speed, which is
    stable for any stiffness. P. Dahl, "A solid friction model", Aerospace Corporation, 1968.
    """

    def __init__(self, robot: Robot) -> None:
        self._out, self._inward = robot.friction_out, robot.friction_in
        self._load = robot.load_friction if robot.load_friction.any() else None
        self._symmetric = bool(np.array_equal(self._out, self._inward))
        self._force = np.zeros(len(self._out))
        self._rate = -robot.step / BRISTLE

    def __call__(self, state: State) -> Floats:
        """Friction (tendons,) [N], positive where it adds to the pull."""
        velocity = state.velocity
        level = self._out
        if not self._symmetric:
            level = np.where(velocity > 0.0, self._out, self._inward)
        if self._load is not None:
            level = level + self._load * state.pull
        end = np.sign(velocity)
        end *= level
        decay = np.abs(velocity)
        decay *= self._rate
        np.exp(decay, out=decay)
        self._force -= end
        self._force *= decay
        self._force += end
        return self._force
