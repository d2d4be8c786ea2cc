"""Replay: what a machine would have read, given what was commanded."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from reality_gap.causes.base import Record
from reality_gap.simulation.episode import Task, compile_with_probes, simulate
from reality_gap.simulation.hypothesis import Plant
from reality_gap.study.data import Episode, Study
from reality_gap.study.measurements import Measured
from reality_gap.types import Floats, Ints


@dataclass(frozen=True)
class Replay:
    """What a replay gives.

    Attributes:
        prediction: (n,) of each reading, in the order of `Measured`; nan where it diverged.
        records: one per episode.
    """

    prediction: Floats
    records: tuple[Record, ...]


class Memory:
    """Records of the latest simulations: many suspects change readings or one episode only."""

    def __init__(self, most: float = 2e8) -> None:
        self._records: OrderedDict[Hashable, Record] = OrderedDict()
        self._room = most

    def recall(self, key: Hashable, make: Callable[[], Record]) -> Record:
        """The record of ``key``, made if it is not remembered; with a copy of its sensors."""
        if key not in self._records:
            record = make()
            self._records[key] = record
            self._room -= record.sensors.nbytes
            while self._room < 0 and len(self._records) > 1:
                self._room += self._records.popitem(last=False)[1].sensors.nbytes
        self._records.move_to_end(key)
        record = self._records[key]
        return replace(record, sensors=record.sensors.copy())


def replay(plant: Plant, study: Study, measured: Measured, memory: Memory | None = None) -> Replay:
    """Replay a study on a plant; ``memory`` spares simulations that were done before.

    A controller reads its sensors, then commands: a reading taken at the time of a command is one
    under the command before it.
    """
    # A hook may want a body by its name.
    model = compile_with_probes(plant.spec, fuse=not plant.effects.hooks)
    starts = np.concatenate([[0.0], np.cumsum([e.duration for e in study.episodes])])
    prediction = np.full(len(measured.value), np.nan)
    records = []
    for e, (episode, start) in enumerate(zip(study.episodes, starts[:-1], strict=True)):
        rows = _rows(model, episode)
        record = _run(plant, model, study, episode, float(start), rows, memory)
        for sense in plant.effects.readings:
            sense(record)
        at = measured.episode == e
        columns = np.array([record.column(c.sensor, c.component) for c in study.channels])
        prediction[at] = _read(
            record, episode, rows, measured.time[at], columns[measured.channel[at]]
        )
        records.append(record)
    return Replay(measured.align(prediction), tuple(records))


def _rows(model: mujoco.MjModel, episode: Episode) -> Ints:
    """The latest row of the episode's commands that acts within every step (k,)."""
    step = model.opt.timestep
    time = step * np.arange(int(np.ceil(episode.duration / step)) + 2)
    return (np.searchsorted(episode.time, time + step - 1e-9, side="left") - 1).clip(0)


def _commands(episode: Episode, rows: Ints, step: float) -> Floats:
    """The mean command of every step (k, nu): a command may come in the middle of one."""
    command = episode.command[rows].copy()
    new = np.flatnonzero(np.diff(rows, prepend=rows[0]) > 0)
    share = ((new + 1) * step - episode.time[rows[new]]) / step
    before = episode.command[rows[new - 1]]
    command[new] = before + share.clip(0.0, 1.0)[:, None] * (command[new] - before)
    return command


def _run(
    plant: Plant,
    model: mujoco.MjModel,
    study: Study,
    episode: Episode,
    start: float,
    rows: Ints,
    memory: Memory | None,
) -> Record:
    """Simulate one episode; time in the record and for hooks counts from the study's begin."""
    time = start + model.opt.timestep * np.arange(len(rows))
    command = _commands(episode, rows, model.opt.timestep)
    for effect in plant.effects.commands:
        command = effect(model, time, command)
    initial = study.initial
    task = Task(start, command, {**initial.joints, **episode.joints}, initial.settle)
    hooks = [h for h in plant.effects.hooks if h.start < time[-1] and h.end > start]
    if memory is None or hooks:
        return simulate(model, task, hooks)
    key = (plant.edits, model.opt.timestep, start, command.tobytes())
    return memory.recall(key, lambda: simulate(model, task, hooks))


def _read(record: Record, episode: Episode, rows: Ints, time: Floats, column: Ints) -> Floats:
    """Readings at ``time`` (m,), on a line through two steps under the same command."""
    step = record.time[1] - record.time[0]
    allowed = (np.searchsorted(episode.time, time - 1e-9, side="left") - 1).clip(0)
    last = np.searchsorted(rows, allowed, side="right") - 1
    first = np.searchsorted(rows, allowed, side="left")
    later = np.minimum(np.floor(time / step + 1e-9).astype(int), last)
    later = np.clip(np.maximum(later, first), 1, len(rows) - 1)
    earlier = np.where(later > first, later - 1, later)
    slope = record.sensors[later, column] - record.sensors[earlier, column]
    return record.sensors[later, column] + (time / step - later) * slope
