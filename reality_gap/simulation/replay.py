"""Replay: the readings that a plant predicts for the commands of a study.

Each episode is simulated from its initial state with the commands of the log. The sensors are then
interpolated at the times of the measured readings.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Collection, Hashable, Mapping
from dataclasses import dataclass, fields, replace

import mujoco
import numpy as np

from reality_gap.causes.base import Record
from reality_gap.simulation.episode import NewState, Task, compile_with_probes, simulate
from reality_gap.simulation.hypothesis import Plant
from reality_gap.study.data import Episode, ReadState, Study
from reality_gap.study.measurements import Measured
from reality_gap.types import Bools, Floats, Ints


@dataclass(frozen=True)
class Replay:
    """Result of a replay.

    Attributes:
        prediction: predicted readings in the order of `Measured` in SI units, shape (n,); NaN in
            an episode whose simulation diverged.
        records: the simulated signals of each episode.
    """

    prediction: Floats
    records: tuple[Record, ...]


class RecordCache:
    """Cache of the latest simulations.

    Many candidates change the readings or one episode only, so that simulations repeat.

    Args:
        size: how much memory the records may take [bytes].
    """

    def __init__(self, size: float = 2e8) -> None:
        self._records: OrderedDict[Hashable, Record] = OrderedDict()
        self._free = size

    def get(self, key: Hashable, make: Callable[[], Record]) -> Record:
        """Return the record of ``key`` with a copy of its sensors; make it if it is not cached."""
        if key not in self._records:
            record = make()
            self._records[key] = record
            self._free -= _bytes(record)
            while self._free < 0 and len(self._records) > 1:
                self._free += _bytes(self._records.popitem(last=False)[1])
        self._records.move_to_end(key)
        record = self._records[key]
        return replace(record, sensors=record.sensors.copy())


def _bytes(record: Record) -> int:
    """Return the memory of a record with its model [bytes]."""
    signals = (getattr(record, field.name) for field in fields(record) if field.name != "model")
    return sum(int(signal.nbytes) for signal in signals) + int(record.model.nbuffer)


def replay(
    plant: Plant,
    study: Study,
    measured: Measured,
    cache: RecordCache | None = None,
    only: Collection[int] | None = None,
) -> Replay:
    """Replay a study on a plant.

    A controller reads its sensors before it commands: a force that was read at the time of a
    command belongs to the command before it. Positions and velocities of the model depend on no
    command; what effects add to them may, as the stretch of an elastic tendon does.

    Args:
        plant: the model and its effects; probes are added to its spec.
        study: commands and initial states.
        measured: the readings of that study.
        cache: simulations that were done before, if they may be used again.
        only: indices of the episodes to simulate; by default all. The predictions of the others are
            NaN, and they have no record.

    Returns:
        The predicted readings and the simulated signals.
    """
    # Fusing removes bodies that a hook may refer to by name.
    model = compile_with_probes(plant.spec, fuse=not plant.effects.hooks)
    forces = np.array([is_force(model, c.sensor) for c in study.channels])
    starts = np.concatenate([[0.0], np.cumsum([e.duration for e in study.episodes])])
    prediction = np.full(len(measured.value), np.nan)
    records = []
    for e, (episode, start) in enumerate(zip(study.episodes, starts[:-1], strict=True)):
        if only is not None and e not in only:
            continue
        rows = command_rows(model, episode)
        record = _simulate(plant, model, study, episode, float(start), rows, cache)
        plain = record.sensors.copy() if plant.effects.readings else record.sensors
        for effect in plant.effects.readings:
            effect(record)
        at = measured.episode == e
        prediction[at] = 0.0
        columns = np.array([record.column(c.sensor, c.component) for c in study.channels])
        channel, time = measured.channel[at], measured.time[at]
        parts: list[tuple[Floats, Bools | bool]] = [(plain, forces[channel])]
        if plant.effects.readings:
            jump = True if plant.effects.of_forces else forces[channel]
            parts.append((record.sensors - plain, jump))
        for values, forced in parts:
            one = replace(record, sensors=values)
            prediction[at] += read_sensors(one, episode, rows, time, columns[channel], forced)
        records.append(record)
    return Replay(measured.align(prediction), tuple(records))


def is_force(model: mujoco.MjModel, sensor: str) -> bool:
    """Return whether readings of a sensor are forces or accelerations, which commands change."""
    stage = int(model.sensor_needstage[model.sensor(sensor).id])
    return stage >= int(mujoco.mjtStage.mjSTAGE_ACC)


def read_sensors(
    record: Record,
    episode: Episode,
    rows: Ints,
    time: Floats,
    column: Ints | int,
    forces: Bools | bool,
) -> Floats:
    """Return what sensors read in a replay; see `replay` for forces at the time of a command.

    Args:
        record: the replay of an episode.
        episode: when commands were given.
        rows: see `command_rows`.
        time: of the readings, shape (m,) [s].
        column: in the record's sensors, shape (m,) or ().
        forces: whether readings are forces, shape (m,) or ().
    """
    now = time / _step(record)
    steps = _steps(episode, rows, now, time, forces)
    return _interpolate(record.sensors, steps, now, column)


def command_rows(model: mujoco.MjModel, episode: Episode) -> Ints:
    """Return the latest row of the commands that acts within each physics step, shape (k,)."""
    step = model.opt.timestep
    time = step * np.arange(int(np.ceil(episode.duration / step)) + 2)
    return (np.searchsorted(episode.time, time + step - 1e-9, side="left") - 1).clip(0)


def _commands(episode: Episode, rows: Ints, step: float) -> Floats:
    """Return the mean command of each physics step (k, nu), within which commands may change."""
    command = episode.command[rows].copy()
    new = np.flatnonzero(np.diff(rows, prepend=rows[0]) > 0)
    share = ((new + 1) * step - episode.time[rows[new]]) / step
    before = episode.command[rows[new - 1]]
    command[new] = before + share.clip(0.0, 1.0)[:, None] * (command[new] - before)
    return command


def _simulate(
    plant: Plant,
    model: mujoco.MjModel,
    study: Study,
    episode: Episode,
    start: float,
    rows: Ints,
    cache: RecordCache | None,
) -> Record:
    """Simulate one episode; times of the record and of hooks count from the study's begin."""
    time = start + model.opt.timestep * np.arange(len(rows))
    command = _commands(episode, rows, model.opt.timestep)
    for effect in plant.effects.commands:
        command = effect(model, time, command)
    states, initial = _true_states(plant, episode.states), study.initial
    read = {joint: state.position for joint, state in states.items()}
    speeds = {joint: 0.0 if initial.settle else state.speed for joint, state in states.items()}
    joints = {**initial.joints, **episode.joints, **read}
    restarts = _restarts(plant, episode, model.opt.timestep)
    task = Task(start, command, joints, speeds, initial.settle, restarts)
    hooks = [h for h in plant.effects.hooks if h.start < time[-1] and h.end > start]
    if cache is None or hooks:
        return simulate(model, task, hooks)
    again = repr((states, restarts))
    key = (plant.edits, model.opt.timestep, start, command.tobytes(), again)
    return cache.get(key, lambda: simulate(model, task, hooks))


def _true_states(plant: Plant, read: Mapping[str, ReadState]) -> dict[str, ReadState]:
    """Return the states of joints whose readings have the errors of a plant."""
    states = dict(read)
    for begin in reversed(plant.effects.starts):
        begin(states)
    return states


def _restarts(plant: Plant, episode: Episode, step: float) -> list[NewState]:
    """Return the states in which a replay begins again, at the next physics step [s] each."""
    found = []
    for time, read in episode.restarts:
        states, index = _true_states(plant, read), int(np.ceil(time / step - 1e-6))
        late = index * step - time
        joints = {joint: state.position + late * state.speed for joint, state in states.items()}
        found.append(NewState(index, joints, {joint: s.speed for joint, s in states.items()}))
    return found


def _steps(
    episode: Episode, rows: Ints, now: Floats, time: Floats, forces: Bools | bool
) -> tuple[Ints, Ints]:
    """Return the earlier and the later step between which, or after which, readings are taken.

    Positions and velocities lie between two steps. Forces jump with the commands, so that they
    follow from two steps under the command before them; from one if there are no two.

    Args:
        episode: when commands were given.
        rows: see `command_rows`.
        now: time of the readings in physics steps, shape (m,).
        time: the same, shape (m,) [s].
        forces: whether readings are forces, which depend on the command, shape (m,) or ().
    """
    floor = np.floor(now + 1e-9).astype(int)
    between = np.clip(floor + 1, 1, len(rows) - 1)
    if not np.any(forces):
        return between - 1, between
    allowed = (np.searchsorted(episode.time, time - 1e-9, side="left") - 1).clip(0)
    last = np.searchsorted(rows, allowed, side="right") - 1
    first = np.searchsorted(rows, allowed, side="left")
    before = np.minimum(np.maximum(np.minimum(floor, last), first), len(rows) - 1)
    later = np.where(forces, before, between)
    return np.where(forces & (before <= first), later, later - 1), later


def _interpolate(
    values: Floats, steps: tuple[Ints, Ints], now: Floats, column: Ints | int
) -> Floats:
    """Return values between two steps, or the same at a single one, shape (m,).

    Args:
        values: of all sensors at each step, shape (k, nsensordata).
        steps: see `_steps`.
        now: time of the readings in physics steps, shape (m,).
        column: of each reading, shape (m,) or ().
    """
    earlier, later = steps
    slope = values[later, column] - values[earlier, column]
    return np.asarray(values[later, column] + (now - later) * slope)


def _step(record: Record) -> float:
    """Return the physics step [s]."""
    return float(record.model.opt.timestep)
