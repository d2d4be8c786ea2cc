"""The control loop of a real machine, one pass for each physics step."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from hidden_plants.robot import Robot, State
from hidden_plants.types import Floats

SETTLE = 1.0
"""How long the first command is held before an episode begins [s]."""
BRISTLE = 2e-5
"""Travel within which dry friction of a wire builds up [m]."""
STRIDE = 2
"""Physics steps from one stored sample to the next."""


@dataclass(frozen=True)
class Task:
    """What a machine is asked to do in one episode.

    Attributes:
        time: of the commands (n,) [s], rising from 0; each is held until the next.
        command: target lengths (n, wires) [m].
        initial: joint positions at which the first command begins to act (joints,) [rad].
        duration: [s].
        start: where the episode begins in the log, episodes end to end [s].
    """

    time: Floats
    command: Floats
    initial: Floats
    duration: float
    start: float


@dataclass(frozen=True)
class Trace:
    """What really happened in one episode, on an even grid.

    Attributes:
        time: (k,) [s], from shortly before 0.
        encoder: what the controllers were told (k, wires) [m].
        tension: at the motors (k, wires) [N].
        qpos: (k, joints) [rad].
    """

    time: Floats
    encoder: Floats
    tension: Floats
    qpos: Floats


def run_task(robot: Robot, task: Task) -> Trace:
    """Let the machine settle under the first command, then do the task."""
    model, machine = robot.model, robot.machine
    data = mujoco.MjData(model)
    data.qpos[:] = task.initial
    count = len(machine.tendons)
    zero = machine.lengths(machine.model.qpos0)[0] + robot.offset
    offset = zero - robot.scale * robot.zero_lengths()
    plan = _plan(robot, task)
    step, settle, steps = robot.step, round(SETTLE / robot.step), len(plan)
    state = State(
        model=model,
        data=data,
        length=data.ten_length,
        velocity=data.ten_velocity,
        encoder=np.empty(count),
        motor=np.full(count, robot.bias),
        pull=np.empty(count),
        step=step,
    )
    encode = [make() for make in robot.encode]
    drive = [make() for make in robot.drive]
    tug = [make() for make in robot.tug]
    body = [make() for make in robot.body]
    friction = TendonFriction(robot)
    rows = (steps - settle) // STRIDE + 1
    trace = np.empty((rows, 2 * count + model.nq))
    row = 0
    step1, step2 = mujoco.mj_step1, mujoco.mj_step2
    encoder, motor, pull = state.encoder, state.motor, state.pull
    control, applied, pushed = data.ctrl, data.qfrc_applied, data.xfrc_applied
    length, scale, bias, cut = state.length, robot.scale, robot.bias, robot.cut
    stiffness, gain, force_offset = robot.stiffness, robot.gain, robot.force_offset
    multiply, add, subtract = np.multiply, np.add, np.subtract
    maximum, minimum = np.maximum, np.minimum
    for k in range(steps):
        state.time = (k - settle) * step
        state.log_time = task.start + max(0.0, state.time)
        step1(model, data)
        multiply(length, scale, encoder)
        add(encoder, offset, encoder)
        for act in encode:
            act(state)
        subtract(encoder, plan[k], motor)
        multiply(motor, stiffness, motor)
        add(motor, bias, motor)
        maximum(motor, bias, out=motor)
        minimum(motor, cut, out=motor)
        for act in drive:
            act(state)
        multiply(motor, gain, motor)
        add(motor, force_offset, motor)
        pull[:] = motor
        for act in tug:
            act(state)
        add(pull, friction(state), control)
        if body:
            applied[:] = 0.0
            pushed[:] = 0.0
            for act in body:
                act(state)
        if k >= settle and not (k - settle) % STRIDE:
            stored = trace[row]
            stored[:count] = encoder
            stored[count : 2 * count] = motor
            stored[2 * count :] = data.qpos
            row += 1
        step2(model, data)
    return Trace(
        time=STRIDE * step * np.arange(row, dtype=np.float64),
        encoder=trace[:row, :count],
        tension=trace[:row, count : 2 * count],
        qpos=trace[:row, 2 * count :],
    )


def _plan(robot: Robot, task: Task) -> Floats:
    """The command of every physics step, settling included (steps, wires) [m].

    A step takes the mean of the command from half a step before to half a step after, so that the
    instant of a command does not snap to a step. There are a few steps more than the duration, so
    that the last sample lies inside.
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


class TendonFriction:
    """Dry friction of all wires: bristles that bend over `BRISTLE`, then slide (Dahl's model).

    The level is that of the direction of motion, plus a share of the tension, as a capstan's. The
    bending is integrated in closed form over a step of constant speed, so it is stable for any
    stiffness. P. Dahl, "A solid friction model", Aerospace Corporation, 1968.
    """

    def __init__(self, robot: Robot) -> None:
        self.out, self.inward = robot.friction_out, robot.friction_in
        self.load = robot.load_friction if robot.load_friction.any() else None
        self.one_way = bool(np.array_equal(self.out, self.inward))
        self.force = np.zeros(len(self.out))
        self.step = robot.step
        self.rate = np.empty(len(self.out))
        self.way = np.empty(len(self.out))

    def __call__(self, state: State) -> Floats:
        """Friction (wires,) [N], positive where it adds to the pull."""
        velocity, force, rate, way = state.velocity, self.force, self.rate, self.way
        level = self.out if self.one_way else np.where(velocity > 0.0, self.out, self.inward)
        if self.load is not None:
            level = level + self.load * state.pull
        np.sign(velocity, way)
        np.abs(velocity, rate)
        rate *= -self.step / BRISTLE
        np.exp(rate, rate)
        way *= level
        force -= way
        force *= rate
        force += way
        return force
