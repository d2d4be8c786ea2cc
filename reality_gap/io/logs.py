"""Logs: reads the files of one episode, which share a clock, as commands and readings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reality_gap.errors import StudyError
from reality_gap.io.schema import Files, Line, StudyFile
from reality_gap.io.tables import Table, read_header, read_table
from reality_gap.io.yaml_reader import nearest
from reality_gap.study.data import Episode, Reading
from reality_gap.types import Floats

MIN_DURATION, MAX_DURATION = 0.5, 3600.0
"""Shortest and longest episode [s]."""

MIN_SAMPLES = 20
"""Smallest number of readings of the channel that has most of them in an episode."""


@dataclass(frozen=True)
class Logs:
    """The files of one episode, with the columns that the study uses.

    Attributes:
        study: the study file, whose path is named in errors.
        tables: tables by file name, the one with the commands first.
        times: times of the rows by file name, from the first command [s].
        begin: time of the first command by its clock [s].
    """

    study: StudyFile
    tables: dict[str, Table]
    times: dict[str, Floats]
    begin: float


def read_episode(
    study: StudyFile,
    files: Files,
    name: str,
    actuators: tuple[str, ...],
    measured: tuple[tuple[str, Line], ...],
) -> Episode:
    """Read an episode.

    Readings before the first command are left out, because the command at that time is unknown.

    Args:
        study: the study file.
        files: the files of the episode.
        name: name of the episode.
        actuators: names in the order of the model; their commands must be in the first file.
        measured: label of each measurement, such as "sensor length_biceps", and its line.

    Returns:
        The episode; its readings are in the order of ``measured``, component by component.

    Raises:
        StudyError: a file, a column, a time or a command is missing or wrong.
    """
    logs = _open(study, files, actuators, measured)
    time = logs.times[files.names[0]]
    readings = tuple(
        _reading(logs, what, line, i) for what, line in measured for i in range(len(line.columns))
    )
    _check_clocks(logs)
    start = logs.begin if files.start is None else files.start
    commands = _commands(logs, actuators)
    episode = Episode(name, time, commands, readings, files.joints, files.log, start)
    _check_length(study, episode)
    return episode


def _open(
    study: StudyFile,
    files: Files,
    actuators: tuple[str, ...],
    measured: tuple[tuple[str, Line], ...],
) -> Logs:
    headers = {name: read_header(study.locate(name), name) for name in files.names}
    clock = study.time.columns[0]
    wanted = {name: [clock] for name in files.names}
    for name, header in headers.items():
        if clock not in header:
            raise _missing(study, f"time column {clock!r}", clock, {name: header})
    commands = files.names[0]
    for actuator in actuators:
        column = study.actuators[actuator].columns[0]
        if column not in headers[commands]:
            what = f"column {column!r} of actuator {actuator}"
            raise _missing(study, what, column, {commands: headers[commands]})
        wanted[commands].append(column)
    for what, line in measured:
        for column in line.columns:
            wanted[_holder(study, what, column, headers)].append(column)
    tables = {
        name: read_table(study.locate(name), name, tuple(dict.fromkeys(columns)))
        for name, columns in wanted.items()
    }
    times = {
        name: _time(study, table) + files.shifts.get(name, 0.0) for name, table in tables.items()
    }
    begin = float(times[commands][0])
    return Logs(study, tables, {name: time - begin for name, time in times.items()}, begin)


def _holder(study: StudyFile, what: str, column: str, headers: dict[str, tuple[str, ...]]) -> str:
    """Return the name of the only file that has a column."""
    holders = [name for name, header in headers.items() if column in header]
    if not holders:
        raise _missing(study, f"column {column!r} of {what}", column, headers)
    if len(holders) > 1:
        raise StudyError(
            f"{study.path}: column {column!r} of {what} is in {' and in '.join(holders)}; a "
            "column must be in one file of an episode only"
        )
    return holders[0]


def _missing(
    study: StudyFile, what: str, column: str, headers: dict[str, tuple[str, ...]]
) -> StudyError:
    known = tuple(dict.fromkeys(name for header in headers.values() for name in header if name))
    return StudyError(
        f"{study.path}: there is no {what} in {' or '.join(headers)}; the columns are: "
        f"{nearest(column, known)}"
    )


def _time(study: StudyFile, table: Table) -> Floats:
    time = study.time.in_si(table.columns[study.time.columns[0]])
    empty = np.flatnonzero(np.isnan(time))
    if len(empty):
        raise StudyError(f"{table.location(int(empty[0]))} has no time; every row needs one")
    wrong = np.flatnonzero(np.diff(time) <= 0.0)
    if len(wrong):
        row = int(wrong[0]) + 1
        how = "repeats" if time[row] == time[row - 1] else "falls below"
        raise StudyError(
            f"the time {time[row]:.6g} s in {table.location(row)} {how} that of the row before; "
            "times must increase from row to row"
        )
    return time


def _commands(logs: Logs, actuators: tuple[str, ...]) -> Floats:
    table = next(iter(logs.tables.values()))
    lines = [logs.study.actuators[actuator] for actuator in actuators]
    rows = len(next(iter(table.columns.values())))
    command = np.zeros((rows, len(lines)))
    for i, line in enumerate(lines):
        command[:, i] = line.in_si(table.columns[line.columns[0]])
        empty = np.flatnonzero(np.isnan(command[:, i]))
        if len(empty):
            raise StudyError(
                f"{table.location(int(empty[0]))} has no command in column {line.columns[0]!r}; "
                "every row needs all commands (put readings at other times into a file of their "
                "own)"
            )
    return command


def _reading(logs: Logs, what: str, line: Line, component: int) -> Reading:
    column = line.columns[component]
    name, table = next((n, t) for n, t in logs.tables.items() if column in t.columns)
    value, time = line.in_si(table.columns[column]), logs.times[name]
    known = ~np.isnan(value) & (time >= 0.0)
    return Reading(time[known], value[known])


def _check_clocks(logs: Logs) -> None:
    commands, *others = logs.times
    end = logs.times[commands][-1]
    for name in others:
        time = logs.times[name]
        if time[-1] < 0.0 or (end > 0.0 and time[0] > end):
            raise StudyError(
                f"the times of {name} ({time[0]:.6g} to {time[-1]:.6g} s from the first command) "
                f"do not overlap those of {commands} (0 to {end:.6g} s); both must use one clock"
            )


def _check_length(study: StudyFile, episode: Episode) -> None:
    duration, unit = episode.duration, study.time.unit.symbol
    if not MIN_DURATION <= duration <= MAX_DURATION:
        raise StudyError(
            f"{study.path}: episode {episode.name} lasts {duration:.6g} s; valid are "
            f"{MIN_DURATION:g} to {MAX_DURATION:g} s (is the time in {unit}?)"
        )
    samples = max(len(reading.time) for reading in episode.readings)
    if samples < MIN_SAMPLES:
        raise StudyError(
            f"{study.path}: no channel of episode {episode.name} has more than {samples} readings; "
            f"at least {MIN_SAMPLES} are needed"
        )
