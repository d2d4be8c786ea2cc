"""Simulation of one episode: sensors and states at each physics step."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco import rollout

from reality_gap.causes.base import Hook, Record, ScheduledHook
from reality_gap.simulation.closed_loops import set_state
from reality_gap.types import Floats

PROBE = "reality_gap/"
"""Prefix of the names of the sensors that `compile_with_probes` adds."""


def compile_with_probes(spec: mujoco.MjSpec, fuse: bool) -> mujoco.MjModel:
    """Compile a model with additional sensors for the signals of a `Record`.

    Args:
        spec: the model; the sensors are added to it.
        fuse: whether to fuse bodies that are fixed to each other, which is faster.
    """
    kinds = mujoco.mjtSensor
    actuators = [a.name for a in spec.actuators]
    tendons = [t.name for t in spec.tendons]
    for kind, element, names in (
        (kinds.mjSENS_ACTUATORFRC, mujoco.mjtObj.mjOBJ_ACTUATOR, actuators),
        (kinds.mjSENS_TENDONPOS, mujoco.mjtObj.mjOBJ_TENDON, tendons),
        (kinds.mjSENS_TENDONVEL, mujoco.mjtObj.mjOBJ_TENDON, tendons),
    ):
        for name in names:
            spec.add_sensor(
                name=f"{PROBE}{int(kind)}/{name}", type=kind, objtype=element, objname=name
            )
    spec.compiler.fusestatic = fuse
    return spec.compile()


def silence() -> None:
    """Keep MuJoCo from writing MUJOCO_LOG.TXT; a replay that diverges is recognised by NaN."""
    mujoco.set_mju_user_warning(lambda message: None)


class NewState(NamedTuple):
    """State of some joints within an episode, whatever they did before.

    Attributes:
        step: index of the physics step at whose begin they have it.
        joints, speeds: positions [m or rad] and velocities [m/s or rad/s] by joint.
    """

    step: int
    joints: Mapping[str, float]
    speeds: Mapping[str, float]


@dataclass(frozen=True)
class Task:
    """Input of the simulation of one episode.

    Attributes:
        start: time of the study at which the episode begins [s].
        command: command at each physics step, shape (k, nu).
        joints: positions of joints before settling [m or rad].
        speeds: their velocities [m/s or rad/s]; 0 for joints that are not there.
        settle: how long the first command is held before the episode begins [s].
        restarts: when joints have new states, in this order.
    """

    start: float
    command: Floats
    joints: Mapping[str, float]
    speeds: Mapping[str, float]
    settle: float
    restarts: Sequence[NewState] = ()


def simulate(model: mujoco.MjModel, task: Task, hooks: Sequence[ScheduledHook]) -> Record:
    """Simulate an episode.

    Args:
        model: the compiled model, with probes; see `compile_with_probes`.
        task: commands and initial state.
        hooks: hooks that act in this episode.

    Returns:
        Signals at the begin of each physics step, under its command; all sensors are NaN if the
        simulation diverged.
    """
    if hooks:
        model = copy.copy(model)  # hooks write into it
    data = mujoco.MjData(model)
    step = model.opt.timestep
    set_state(model, data, task.joints, task.speeds)
    for i in range(model.nactuator):
        if model.actuator_actnum[i] == 1 and model.actuator_ctrlnum[i] == 1:
            data.act[model.actuator_actadr[i]] = task.command[0, model.actuator_ctrladr[i]]
    settling = round(task.settle / step)
    data.time = task.start - settling * step
    _fill_histories(model, data, task.command[0])
    running = [_Running(h, h.make(model)) for h in hooks]
    _advance(model, data, running, np.repeat(task.command[:1], settling, axis=0), None)
    record = _empty_record(model, task.start + step * np.arange(len(task.command)))
    begin = 0
    for index, joints, speeds in task.restarts:
        part = task.command[begin:index]
        _advance(model, data, running, part, _part(record, begin, index))
        set_state(model, data, joints, speeds)
        begin = index
    _advance(model, data, running, task.command[begin:], _part(record, begin))
    count = len(record.force[0]), len(record.length[0])
    probes = record.sensors[:, model.nsensordata - count[0] - 2 * count[1] :]
    record.force[:] = probes[:, : count[0]]
    record.length[:] = probes[:, count[0] : count[0] + count[1]]
    record.velocity[:] = probes[:, count[0] + count[1] :]
    if data.warning.number.any():
        record.sensors[:] = np.nan
    return record


def _part(record: Record, begin: int, end: int | None = None) -> Record:
    """Return the signals of some steps, as views."""
    signals = (one.name for one in fields(record) if one.name != "model")
    return replace(record, **{name: getattr(record, name)[begin:end] for name in signals})


def _fill_histories(model: mujoco.MjModel, data: mujoco.MjData, command: Floats) -> None:
    """Fill the command histories of delayed actuators with the first command."""
    for i in np.flatnonzero(model.actuator_history[:, 0]):
        count = int(model.actuator_history[i, 0])
        past = data.time - model.opt.timestep * np.arange(count, 0, -1)
        mujoco.mj_initCtrlHistory(
            model, data, int(i), past, np.full(count, command[model.actuator_ctrladr[i]])
        )


@dataclass(frozen=True)
class _Running:
    """A scheduled hook and its instance for the current episode."""

    schedule: ScheduledHook
    hook: Hook


def _advance(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    running: Sequence[_Running],
    command: Floats,
    record: Record | None,
) -> None:
    """Simulate commands (k, nu) in C if no hook needs more than the time, else in Python."""
    if not len(command):
        return
    end = data.time + len(command) * model.opt.timestep
    active = [r for r in running if r.schedule.start < end and r.schedule.end > data.time]
    wrenches = None if record is None else _wrenches(model, data, active, len(command))
    if not active or wrenches is not None:
        _advance_in_c(model, data, command, wrenches, record)
        return
    every = max(1, min(round(r.schedule.period / model.opt.timestep) for r in active))
    due = np.arange(len(command)) % every == 0
    due[1:] |= np.any(command[1:] != command[:-1], axis=1)
    calls = [(r.hook, r.schedule.start, r.schedule.end) for r in active]
    ctrl, qpos, qvel, sensors = data.ctrl, data.qpos, data.qvel, data.sensordata
    applied, pushed = data.qfrc_applied, data.xfrc_applied
    for k, call in enumerate(due.tolist()):
        if record is not None:
            record.qpos[k], record.qvel[k] = qpos, qvel
        if call:
            ctrl[:] = command[k]
            applied[:] = 0.0
            pushed[:] = 0.0
            now = data.time
            for hook, start, end in calls:
                if start < now < end:
                    hook(model, data)
        mujoco.mj_step(model, data)
        if record is not None:
            record.sensors[k] = sensors


def _wrenches(
    model: mujoco.MjModel, data: mujoco.MjData, active: Sequence[_Running], steps: int
) -> Floats | None:
    """Return the wrenches of all hooks on all bodies at each step, shape (k, 6 nbody).

    None if there are no hooks, or if a hook depends on more than the time.
    """
    time = data.time + model.opt.timestep * np.arange(steps)
    total = None
    for schedule in (r.schedule for r in active):
        if schedule.wrenches is None:
            return None
        within = (schedule.start < time) & (time < schedule.end)
        wrenches = np.where(within[:, None, None], schedule.wrenches(model, time), 0.0)
        total = wrenches if total is None else total + wrenches
    return None if total is None else total.reshape(steps, -1)


def _advance_in_c(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    command: Floats,
    wrenches: Floats | None,
    record: Record | None,
) -> None:
    data.qfrc_applied[:] = 0.0
    data.xfrc_applied[:] = 0.0
    if record is None:
        data.ctrl[:] = command[0]
        mujoco.mj_step(model, data, len(command))
        return
    kind, inputs = mujoco.mjtState.mjSTATE_FULLPHYSICS, mujoco.mjtState.mjSTATE_CTRL
    if wrenches is not None:
        inputs |= mujoco.mjtState.mjSTATE_XFRC_APPLIED
        command = np.hstack([command, wrenches])
    first = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, first, kind)
    states, sensors = rollout.rollout(
        model, data, first[None], command[None], control_spec=int(inputs)
    )
    record.sensors[:] = sensors[0]
    # MuJoCo returns the states after each step and the sensors before it.
    at = np.vstack([first, states[0, :-1]])
    record.qpos[:] = at[:, 1 : 1 + model.nq]
    record.qvel[:] = at[:, 1 + model.nq : 1 + model.nq + model.nv]


def _empty_record(model: mujoco.MjModel, time: Floats) -> Record:
    k = len(time)
    return Record(
        time=time,
        sensors=np.zeros((k, model.nsensordata)),
        force=np.zeros((k, model.nactuator)),
        length=np.zeros((k, model.ntendon)),
        velocity=np.zeros((k, model.ntendon)),
        qpos=np.zeros((k, model.nq)),
        qvel=np.zeros((k, model.nv)),
        model=model,
    )
