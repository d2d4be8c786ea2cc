"""Motion: smooth random commands, and what the machine's sensors read.

Commands are sums of sines inside their ranges. They are made smaller until the machine reaches no
stop and touches nothing, where that is possible. Machines whose torques are logged follow sums of
sines by a controller. Simulation is at half the model's time step.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from experiments.harness.errors import ExperimentError
from experiments.public_models.machine import Machine, with_payload
from jmm_agent.types import Floats

SETTLE = 2.0
"""How long the first command is held before the log begins [s]."""
PERIOD = 0.01
"""Least sampling interval of the log [s]."""
FREQUENCIES = (0.1, 0.8)
"""Range of the frequencies of sines [Hz]."""
SINES = 3
SHARES = (0.7, 0.4, 0.2, 0.1)
"""Amplitudes of commands over half their range, of which the first without contact is taken."""
TOUCHING = 0.02
"""Largest share of time with contacts or stops."""
SWING = 0.9
"""Largest amplitude of the joints of machines that follow by a controller [rad]."""
BANDWIDTH = 12.0
"""Natural frequency of that controller [rad/s]."""


@dataclass(frozen=True)
class Log:
    """A log without noise.

    Attributes:
        time: shape (n,) [s].
        command: commands of the actuators (n, nu), or torques of the joints that are measured.
        readings: shape (n, number of sensors).
        touching: share of time with contacts or stops.
    """

    time: Floats
    command: Floats
    readings: Floats
    touching: float


class Motion:
    """Random motion of a machine.

    Args:
        machine: the machine.
        seed: of the sines.
        seconds: length of the log [s].
    """

    def __init__(self, machine: Machine, seed: int, seconds: float) -> None:
        self.machine = machine
        self.model = self._compile(0.0)
        self.every = max(1, round(PERIOD / self.model.opt.timestep))
        self.count = int(seconds / (self.every * self.model.opt.timestep)) + 1
        rng = np.random.default_rng([seed, 5])
        shape = (SINES, self.model.nu)
        self.frequency = rng.uniform(*FREQUENCIES, shape)
        self.phase = rng.uniform(0.0, 2.0 * np.pi, shape)
        self.share = self._largest_free_share()

    def log(self, mass: float, share: float | None = None) -> Log:
        """Simulate the machine with a payload.

        Args:
            mass: of the payload [kg].
            share: amplitude of the commands over half their range; by default the motion's.

        Raises:
            ExperimentError: the simulation diverges.
        """
        share = self.share if share is None else share
        run = self._follow if self.machine.torques else self._drive
        found = run(self._compile(mass), share)
        if not np.isfinite(found.readings).all():
            raise ExperimentError(f"the simulation of {self.machine.path} diverges")
        return found

    def _largest_free_share(self) -> float:
        """Return the first of `SHARES` without contact, or else the one with the least."""
        touching: dict[float, float] = {}
        for share in SHARES:
            touching[share] = self.log(0.0, share).touching
            if touching[share] <= TOUCHING:
                return share
        return min(touching, key=lambda share: round(touching[share], 1))

    def _compile(self, mass: float) -> mujoco.MjModel:
        spec = with_payload(self.machine, mass)
        model = spec.compile()
        model.opt.timestep *= 0.5
        return model

    def sines(self, time: Floats) -> Floats:
        """Sums of sines, within -1 and 1, at times (n,), shape (n, nu)."""
        angle = 2.0 * np.pi * self.frequency * time[:, None, None] + self.phase
        found: Floats = np.sin(angle).mean(axis=1)
        return found

    def _start(self, model: mujoco.MjModel) -> mujoco.MjData:
        data = mujoco.MjData(model)
        for name, value in self.machine.home.items():
            data.joint(name).qpos = value
        mujoco.mj_forward(model, data)
        return data

    def _drive(self, model: mujoco.MjModel, share: float) -> Log:
        """Simulate under commands that are held for a sampling interval."""
        data, step = self._start(model), model.opt.timestep
        low, high = command_ranges(model)
        time = self.every * step * np.arange(self.count)
        command = 0.5 * (low + high) + 0.5 * (high - low) * share * self.sines(time)
        data.ctrl[:] = command[0]
        for i in np.flatnonzero(model.actuator_actnum == 1):
            data.act[model.actuator_actadr[i]] = command[0, model.actuator_ctrladr[i]]
        mujoco.mj_step(model, data, round(SETTLE / step))
        at = self._sensors(model)
        readings, touching = np.empty((len(time), len(at))), 0
        for k, now in enumerate(command):
            # A controller reads before it commands: the first step is under the command before.
            mujoco.mj_forward(model, data)
            readings[k] = data.sensordata[at]
            data.ctrl[:] = now
            touching += self._touches(model, data)
            mujoco.mj_step(model, data, self.every)
        return Log(time, command, readings, touching / len(time))

    def _follow(self, model: mujoco.MjModel, share: float) -> Log:
        """Simulate a machine that follows by computed torques; torques are those of actuators."""
        nominal = self.model
        data, step = self._start(model), model.opt.timestep
        time = self.every * step * np.arange(self.count)
        joints = [nominal.joint(sensor.element) for sensor in self.machine.sensors]
        dofs = np.array([int(joint.dofadr[0]) for joint in joints])
        home = data.qpos[[int(joint.qposadr[0]) for joint in joints]].copy()
        inertia = nominal.dof_M0[dofs]
        low, high = command_ranges(model)
        order = [self._actuator(model, int(joint.id)) for joint in joints]
        at = self._sensors(model)
        readings, torques = np.empty((2, len(time), len(at)))
        before, touching = round(SETTLE / step), 0
        steps = step * np.arange(-before, self.count * self.every)
        goals = home + SWING * share * (self.sines(steps) - self.sines(steps[:1]))[:, order]
        speeds = np.gradient(goals, step, axis=0)
        for k, (goal, speed) in enumerate(zip(goals, speeds, strict=True), -before):
            mujoco.mj_step1(model, data)
            error, slower = goal - data.sensordata[at], speed - data.qvel[dofs]
            force = inertia * BANDWIDTH * (BANDWIDTH * error + 2.0 * slower) + data.qfrc_bias[dofs]
            data.ctrl[order] = np.clip(
                force / model.actuator_gear[order, 0], low[order], high[order]
            )
            mujoco.mj_step2(model, data)
            if k >= 0 and k % self.every == 0:
                row = k // self.every
                readings[row], torques[row] = data.sensordata[at], data.qfrc_actuator[dofs]
                touching += self._touches(model, data)
        return Log(time, torques, readings, touching / len(time))

    def _actuator(self, model: mujoco.MjModel, joint: int) -> int:
        return int(np.flatnonzero(model.actuator_trnid[:, 0] == joint)[0])

    def _sensors(self, model: mujoco.MjModel) -> list[int]:
        return [int(model.sensor(sensor.name).adr[0]) for sensor in self.machine.sensors]

    def _touches(self, model: mujoco.MjModel, data: mujoco.MjData) -> bool:
        limit = (
            mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT,
            mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON,
        )
        stops = np.isin(data.efc_type[: data.nefc], [int(kind) for kind in limit]).any()
        return bool(data.ncon or stops)


def command_ranges(model: mujoco.MjModel) -> tuple[Floats, Floats]:
    """Lower and upper bounds of commands, (nu,) each; -1 or 0 (muscles) to 1 without a range."""
    limited = model.actuator_ctrllimited.astype(bool)
    muscles = model.actuator_dyntype == int(mujoco.mjtDyn.mjDYN_MUSCLE)
    low = np.where(limited, model.actuator_ctrlrange[:, 0], np.where(muscles, 0.0, -1.0))
    high = np.where(limited, model.actuator_ctrlrange[:, 1], 1.0)
    return low, high
