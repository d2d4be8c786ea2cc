"""Tables: reads CSV and Parquet files as columns of numbers; an empty cell was not measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from reality_gap.errors import StudyError
from reality_gap.io.cells import lists, numbers
from reality_gap.io.headers import Header, csv_header, parquet_header
from reality_gap.types import Floats

MAX_BYTES = 1 << 29
"""Largest log [bytes]."""

MAX_CELLS = 100_000_000
"""Largest number of cells that are read from one log; Parquet files may expand a lot."""

PARQUET = ".parquet"
"""Suffix of Parquet files, in lower case."""

_DAMAGED = (pa.ArrowException, OSError, UnicodeDecodeError)
"""Errors that pyarrow raises for files that contradict their metadata."""


@dataclass(frozen=True)
class Table:
    """Columns of a log.

    Attributes:
        name: name of the file in messages.
        columns: columns by name, shape (n,) each; NaN where a cell is empty.
        first: number of the first row in messages: its line in CSV files, 1 in Parquet files.
    """

    name: str
    columns: dict[str, Floats]
    first: int

    def location(self, row: int) -> str:
        """Return the location of a row for messages, such as "line 14 of episode_0.csv"."""
        return _location(self.name, self.first, row)


def read_header(path: Path, name: str) -> tuple[str, ...]:
    """Read the column names of a log.

    Args:
        path: a .csv or .parquet file.
        name: name of the file in messages.

    Raises:
        StudyError: the file is missing, too large, or not a log.
    """
    return _header(path, name).columns


def read_table(path: Path, name: str, columns: tuple[str, ...]) -> Table:
    """Read columns of a log.

    Args:
        path: a .csv or .parquet file.
        name: name of the file in messages.
        columns: names of columns; each must occur once in the header.

    Raises:
        StudyError: the file is missing, too large or damaged, or a cell is not a number.
    """
    header = _header(path, name)
    for column in columns:
        if header.columns.count(column) > 1:
            raise StudyError(f"{name} has {header.columns.count(column)} columns named {column!r}")
    sources = [header.find(column) for column in columns]
    raw = tuple(dict.fromkeys(name for name, _ in sources))
    if path.suffix.lower() == PARQUET:
        table, first = _read_parquet(path, name, raw), 1
    else:
        table, first = _read_csv(path, name, header, raw), header.skipped + 1
    if table.num_rows == 0:
        raise StudyError(f"{name} has column names but no rows")
    location = partial(_location, name, first)
    found: dict[str, Floats] = {}
    read: dict[str, Floats] = {}
    for column, (held, element) in zip(columns, sources, strict=True):
        cells = table.column(raw.index(held))
        if element is None:
            found[column] = numbers(cells, name, column, location)
        else:
            if held not in read:
                read[held] = lists(cells, header.sizes[held], held, location)
            found[column] = read[held][:, element]
    return Table(name, found, first)


def _location(name: str, first: int, row: int) -> str:
    return f"{'line' if first > 1 else 'row'} {row + first} of {name}"


def _header(path: Path, name: str) -> Header:
    _check_file(path, name)
    if path.suffix.lower() != PARQUET:
        return csv_header(path, name)
    with _open_parquet(path, name) as file:
        try:
            return parquet_header(file)
        except _DAMAGED as error:
            raise StudyError(f"{name} is a damaged Parquet file") from error


def _check_file(path: Path, name: str) -> None:
    if path.suffix.lower() not in (".csv", PARQUET):
        raise StudyError(f"{name} is neither a .csv nor a .parquet file")
    if not path.is_file():
        raise StudyError(f"there is no file {name} in {path.parent}")
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise StudyError(f"{name} has {size >> 20} MiB; a log may have {MAX_BYTES >> 20}")


def _open_parquet(path: Path, name: str) -> pyarrow.parquet.ParquetFile:
    try:
        return pyarrow.parquet.ParquetFile(path)
    except _DAMAGED as error:
        raise StudyError(f"{name} is not a Parquet file, or is truncated or damaged") from error


def _read_parquet(path: Path, name: str, columns: tuple[str, ...]) -> pa.Table:
    with _open_parquet(path, name) as file:
        cells = file.metadata.num_rows * len(columns)
        if cells > MAX_CELLS:
            raise StudyError(f"{name} has {cells} cells; a log may have {MAX_CELLS}")
        try:
            return file.read(columns=list(columns), use_threads=False).select(list(columns))
        except _DAMAGED as error:
            raise StudyError(f"{name} is a damaged Parquet file") from error


def _read_csv(path: Path, name: str, header: Header, columns: tuple[str, ...]) -> pa.Table:
    """Read columns as floats, or as text if a cell is not a number."""
    data = path.read_bytes().rstrip() + b"\n"
    try:
        return _parse_csv(data, header, columns, pa.float64())
    except pa.ArrowInvalid:
        pass
    uneven: list[pyarrow.csv.InvalidRow] = []

    def note(row: pyarrow.csv.InvalidRow) -> str:
        uneven.append(row)
        return "skip"

    data = data.decode("utf-8", "replace").encode()  # pyarrow passes rows to `note` as text
    try:
        table = _parse_csv(data, header, columns, pa.binary(), note)
    except pa.ArrowInvalid as error:
        raise StudyError(f"{name} is not a CSV file: {error}") from error
    if uneven:
        row, last = uneven[0], table.num_rows + len(uneven) + header.skipped
        short = row.actual_columns < row.expected_columns and row.number == last
        raise StudyError(
            f"line {row.number} of {name} has {row.actual_columns} cells, the header "
            f"{row.expected_columns}" + ("; the file looks truncated" if short else "")
        )
    return table


def _parse_csv(
    data: bytes,
    header: Header,
    columns: tuple[str, ...],
    kind: pa.DataType,
    note: Callable[[pyarrow.csv.InvalidRow], str] | None = None,
) -> pa.Table:
    """Parse columns of one type; rows of another length go to ``note``, or are an error."""
    wanted = [str(header.raw.index(column)) for column in columns]
    return pyarrow.csv.read_csv(
        pa.BufferReader(data),
        read_options=pyarrow.csv.ReadOptions(
            use_threads=False,
            skip_rows=header.skipped,
            column_names=[str(i) for i in range(len(header.raw))],
        ),
        parse_options=pyarrow.csv.ParseOptions(ignore_empty_lines=False, invalid_row_handler=note),
        convert_options=pyarrow.csv.ConvertOptions(
            include_columns=wanted,
            column_types=dict.fromkeys(wanted, kind),
            null_values=[""],
            strings_can_be_null=True,
        ),
    )
