"""Recordings: logs of any layout as runs with a time in seconds, for a study that is drafted."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv

from reality_gap.errors import StudyError
from reality_gap.io.column_names import guess_time, guess_time_unit, named_unit
from reality_gap.io.logs import MIN_DURATION, MIN_SAMPLES
from reality_gap.io.tables import read_header, read_table
from reality_gap.io.units import parse_unit
from reality_gap.types import Bools, Floats

TIME = "time"
"""Name of the column of the time in written runs."""
PAUSE, PAUSE_PERIODS = 1.0, 10.0
"""Steps of time that are longer than this [s] and than so many usual ones separate two runs, and
so do steps back of at least `PAUSE`; smaller ones are late packets, which are left out."""

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
    found = _numbers(path, header, clock, note)
    time = found.pop(clock)
    unit = named_unit(clock, ("s",))
    if unit is None:
        unit = guess_time_unit(time)
        if (clock, unit) != (TIME, "s"):
            note(f"{path.name}: the unit of {clock} is not stated and taken as {unit}")
    time = time * parse_unit(unit).factor
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


def _numbers(path: Path, header: Sequence[str], clock: str, note: Note) -> dict[str, Floats]:
    """Read the columns of numbers; those that cannot be read are left out, except for the time."""
    names = tuple(dict.fromkeys(header))
    try:
        return read_table(path, path.name, names).columns
    except StudyError:
        pass  # one by one, to find out which columns cannot be read
    found = {}
    for name in names:
        try:
            found[name] = read_table(path, path.name, (name,)).columns[name]
        except StudyError as error:
            if name == clock:
                raise
            note(f"{path.name}: {name} is left out: {error}")
    return found


def _split(stem: str, time: Floats, columns: dict[str, Floats], note: Note) -> Iterator[Run]:
    """Yield the runs of a log, which restarts of the clock and pauses separate."""
    known = np.flatnonzero(np.isfinite(time))
    steps = np.diff(time[known])
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    pause = max(PAUSE, PAUSE_PERIODS * usual)
    parts = [
        part[_rises(time[part])]
        for part in np.split(known, np.flatnonzero((steps <= -PAUSE) | (steps > pause)) + 1)
    ]
    left_out = len(time) - sum(map(len, parts))
    if left_out:
        note(f"{stem}: {left_out} rows left out, with no time, an equal or an earlier one")
    runs = [
        part
        for part in parts
        if len(part) >= MIN_SAMPLES and time[part[-1]] - time[part[0]] >= MIN_DURATION
    ]
    least = f"a run needs {MIN_SAMPLES} rows and {MIN_DURATION:g} s"
    if len(parts) > 1:
        note(
            f"{stem}: {len(runs)} runs, separated by times that fall or by pauses; "
            f"{len(parts) - len(runs)} were too short ({least})"
        )
    elif not runs:
        note(f"{stem}: its {len(parts[0])} rows are too few or too short; {least}")
    for number, part in enumerate(runs):
        name = stem if len(runs) == 1 else f"{stem}_{number + 1}"
        yield Run(name, time[part], {key: x[part] for key, x in columns.items()})


def _rises(time: Floats) -> Bools:
    """Return which times are above all before them, shape (n,)."""
    before = np.maximum.accumulate(np.r_[-np.inf, time])[:-1]
    above: Bools = time > before
    return above
