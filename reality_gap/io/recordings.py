"""Recordings: logs of any layout as runs with a time in seconds, for a study that is drafted."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv

from reality_gap.errors import StudyError
from reality_gap.io.column_names import guess_time, guess_time_unit, named_unit
from reality_gap.io.foreign_text import is_value, rewrite, without_names
from reality_gap.io.logs import MIN_DURATION, MIN_SAMPLES
from reality_gap.io.tables import PARQUET, read_header, read_table
from reality_gap.io.units import parse_unit
from reality_gap.types import Bools, Floats

TIME = "time"
"""Name of the column of the time in written runs."""
PAUSE, PAUSE_PERIODS = 1.0, 10.0
"""Steps of time that are longer than this [s] and than so many usual ones separate two runs, and
so do steps back of at least `PAUSE`; smaller ones are late packets, which are left out."""
LARGE = 1 << 26
"""Size of a log above which it is not rewritten, only its columns of numbers are read [bytes]."""
MOSTLY = 0.99
"""Share of the steps of a column without a telling name that must rise, for it to be the time."""
_SECONDS = re.compile(r"(.*?)(sec|secs|seconds|s)")
_NANOSECONDS = ("nanosec", "nanosecs", "nanoseconds", "nsec", "nsecs", "ns")

Note = Callable[[str], None]
"""Called with a sentence on what was guessed or left out."""


@dataclass(frozen=True)
class Run:
    """One uninterrupted part of a log.

    Attributes:
        name: stem of the file, with the number of the run if there are several.
        time: time of the rows, shape (n,) [s].
        columns: cells by name, shape (n,) each; NaN where nothing was measured.
        recording: name of the recording, usually the stem of the file.
    """

    name: str
    time: Floats
    columns: dict[str, Floats]
    recording: str


def read_runs(path: Path, note: Note, name: str | None = None) -> list[Run]:
    """Read the runs of a log; columns without numbers are left out.

    Args:
        path: a .parquet file or a table of text, such as a .csv file.
        note: called with a sentence on what was guessed or left out.
        name: name of the recording; by default the stem of the file.

    Raises:
        StudyError: the file cannot be read, or has no column with the time.
    """
    with tempfile.TemporaryDirectory() as folder:
        found = _readable(path, Path(folder), note)
    if found and all(map(is_value, found)):
        raise without_names(path.name)
    _join_stamps(found)
    clock = guess_time(found) or _rising(found)
    if clock is None:
        raise StudyError(
            f"no column of {path.name} is named like a time, such as time_s or timestamp; its "
            f"columns are: {', '.join([*found][:20])}"
        )
    if guess_time([clock]) is None:
        note(f"{path.name}: no column is named like a time; {clock}, which rises, is taken as it")
    time = found.pop(clock)
    unit = named_unit(clock, ("s",))
    if unit is None:
        unit = guess_time_unit(time)
        if (clock, unit) != (TIME, "s"):
            note(f"{path.name}: the unit of {clock} is not stated and taken as {unit}")
    time = time * parse_unit(unit).factor
    _check_digits(path.name, clock, time)
    return list(_split(name or path.stem, time, found, note))


def _readable(path: Path, folder: Path, note: Note) -> dict[str, Floats]:
    """Read the columns of numbers of a log; a table that is no plain CSV file is rewritten."""
    if not path.is_file():
        raise StudyError(f"there is no file {path}")
    plain = path.suffix.lower() in (".csv", PARQUET)
    try:
        if plain:
            names = tuple(dict.fromkeys(read_header(path, path.name)))
            return read_table(path, path.name, names).columns
    except StudyError:
        if path.suffix.lower() == PARQUET or path.stat().st_size > LARGE:
            return _numbers(path, path.name, read_header(path, path.name), note)
    new = folder / "table.csv"
    rewrite(path, new, note)
    try:
        return _numbers(new, path.name, read_header(new, path.name), note)
    except StudyError as error:
        raise StudyError(f"{path.name} cannot be read: {error}") from error


def _join_stamps(columns: dict[str, Floats]) -> None:
    """Replace stamps in two columns, of whole seconds and of nanoseconds, by one in seconds."""
    for name in list(columns):
        found = _SECONDS.fullmatch(name)
        for rest in _NANOSECONDS if found else ():
            other = f"{found[1]}{rest}" if found else ""
            if other in columns:
                stamp = columns.pop(name) + 1e-9 * columns.pop(other)
                columns.update({f"{found[1] if found else ''}time": stamp})
                break


def _rising(columns: dict[str, Floats]) -> str | None:
    """Return the first column that rises from row to row and does not count the rows."""
    for name, cells in columns.items():
        steps = np.diff(cells[np.isfinite(cells)])
        counts = len(steps) and np.all(steps == 1.0)
        if len(steps) >= MIN_SAMPLES and np.mean(steps > 0.0) > MOSTLY and not counts:
            return name
    return None


def _check_digits(name: str, clock: str, time: Floats) -> None:
    """Refuse times of which most are equal to the one before, as those with too few digits are."""
    steps = np.diff(time[np.isfinite(time)])
    if len(steps) and np.mean(steps == 0.0) > 0.5:
        raise StudyError(
            f"most times in column {clock} of {name} are equal to the one before: they were "
            "written with too few digits; write them with more, or relative to the first"
        )


def write_run(run: Run, path: Path) -> None:
    """Write a run as CSV, with its time in the column `TIME`.

    Args:
        run: the run.
        path: file to write.
    """
    columns = {TIME: run.time} | {name: x for name, x in run.columns.items() if name != TIME}
    table = pa.table({name: pa.array(x, from_pandas=True) for name, x in columns.items()})
    pyarrow.csv.write_csv(table, path, pyarrow.csv.WriteOptions(quoting_style="needed"))


def _numbers(path: Path, name: str, header: Sequence[str], note: Note) -> dict[str, Floats]:
    """Read the columns of numbers; those that cannot be read are left out."""
    names = tuple(dict.fromkeys(header))
    try:
        return read_table(path, name, names).columns
    except StudyError:
        pass  # one by one, to find out which columns cannot be read
    found = {}
    for column in names:
        try:
            found[column] = read_table(path, name, (column,)).columns[column]
        except StudyError as error:
            note(f"{name}: {column or 'a column without a name'} is left out: {error}")
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
        yield Run(name, time[part], {key: x[part] for key, x in columns.items()}, stem)


def _rises(time: Floats) -> Bools:
    """Return which times are above all before them, shape (n,)."""
    before = np.maximum.accumulate(np.r_[-np.inf, time])[:-1]
    above: Bools = time > before
    return above
