"""Recordings: logs of any layout as runs with a time in seconds, for a study that is drafted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv

from reality_gap.errors import StudyError
from reality_gap.io.column_names import guess_time, named_unit
from reality_gap.io.logs import MIN_DURATION, MIN_SAMPLES
from reality_gap.io.tables import read_header, read_table
from reality_gap.io.units import parse_unit
from reality_gap.types import Floats

TIME = "time"
"""Name of the column of the time in written runs."""
PAUSE, PAUSE_PERIODS = 1.0, 10.0
"""Steps of time that are longer than this [s] and than so many usual ones separate two runs."""

Note = Callable[[str], None]
"""Called with a sentence on what was guessed or left out."""


@dataclass(frozen=True)
class Run:
    """One uninterrupted part of a log.

    Attributes:
        name: stem of the file, with the number of the run if there are several.
        time: time of the rows, shape (n,) [s].
        columns: cells by name, shape (n,) each; NaN where nothing was measured.
    """

    name: str
    time: Floats
    columns: dict[str, Floats]


def read_runs(path: Path, note: Note) -> list[Run]:
    """Read the runs of a log; columns without numbers are left out.

    Args:
        path: a .csv or .parquet file.
        note: called with a sentence on what was guessed or left out.

    Raises:
        StudyError: the file cannot be read, or has no column with the time.
    """
    header = read_header(path, path.name)
    clock = guess_time(header)
    if clock is None:
        raise StudyError(
            f"no column of {path.name} is named like a time, such as time_s or timestamp; its "
            f"columns are: {', '.join(header[:20])}"
        )
    found, left_out = {}, []
    for name in dict.fromkeys(header):
        try:
            found[name] = read_table(path, path.name, (name,)).columns[name]
        except StudyError:
            if name == clock:
                raise
            left_out.append(name)
    if left_out:
        note(f"{path.name}: left out, as they hold no numbers: {', '.join(left_out)}")
    time = found.pop(clock)
    time = time * _unit_of_time(clock, time)
    return list(_split(path.stem, time, found, note))


def write_run(run: Run, path: Path) -> None:
    """Write a run as CSV, with its time in the column `TIME`.

    Args:
        run: the run.
        path: file to write.
    """
    columns = {TIME: run.time} | {name: x for name, x in run.columns.items() if name != TIME}
    table = pa.table({name: pa.array(x, from_pandas=True) for name, x in columns.items()})
    pyarrow.csv.write_csv(table, path, pyarrow.csv.WriteOptions(quoting_style="needed"))


def _unit_of_time(clock: str, time: Floats) -> float:
    """Return the unit of a time [s], from the name of its column or from the size of its steps."""
    named = named_unit(clock, ("s",))
    if named is not None:
        return parse_unit(named).factor
    steps = np.diff(time[np.isfinite(time)])
    steps = steps[steps > 0.0]
    usual = float(np.median(steps)) if len(steps) else 0.0
    return next(
        (unit for unit, top in ((1.0, 0.5), (1e-3, 500.0), (1e-6, 5e5)) if usual < top), 1e-9
    )


def _split(stem: str, time: Floats, columns: dict[str, Floats], note: Note) -> Iterator[Run]:
    """Yield the runs of a log, which falling times and pauses separate."""
    known = np.isfinite(time)
    known[1:] &= ~(np.diff(time) == 0.0)
    if not known.all():
        note(f"{stem}: {np.sum(~known)} rows with no time, or that of the row before, left out")
    time, columns = time[known], {name: x[known] for name, x in columns.items()}
    steps = np.diff(time)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    ends = np.flatnonzero((steps < 0.0) | (steps > max(PAUSE, PAUSE_PERIODS * usual))) + 1
    parts = [
        part
        for part in np.split(np.arange(len(time)), ends)
        if len(part) >= MIN_SAMPLES and time[part[-1]] - time[part[0]] >= MIN_DURATION
    ]
    if len(ends):
        note(
            f"{stem}: {len(parts)} runs, separated by times that fall or by pauses; "
            f"{len(ends) + 1 - len(parts)} were too short"
        )
    for number, part in enumerate(parts):
        name = stem if len(parts) == 1 else f"{stem}_{number + 1}"
        yield Run(name, time[part], {key: x[part] for key, x in columns.items()})
