"""Tables: reads CSV and Parquet files as columns of numbers; an empty cell was not measured."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet

from reality_gap.errors import StudyError
from reality_gap.types import Floats

MAX_BYTES = 1 << 29
"""Largest log [bytes]."""

MAX_CELLS = 100_000_000
"""Largest number of cells that are read from one log; Parquet files may expand a lot."""

LARGEST = 1e30
"""Largest magnitude of a number; its square is still finite."""

_DAMAGED = (pa.ArrowException, OSError, UnicodeDecodeError)
"""Errors that pyarrow raises for files that contradict their metadata."""

_MAX_HEADER = 1 << 20
"""Largest length of the line of column names [bytes]."""


@dataclass(frozen=True)
class Table:
    """Columns of a log.

    Attributes:
        name: name of the file in messages.
        columns: columns by name, shape (n,) each; NaN where a cell is empty.
        first: number of the first row in messages: 2 in CSV files, 1 in Parquet files.
    """

    name: str
    columns: dict[str, Floats]
    first: int

    def location(self, row: int) -> str:
        """Return the place of a row for messages, such as "line 14 of episode_0.csv"."""
        return _location(self.name, self.first, row)


def read_header(path: Path, name: str) -> tuple[str, ...]:
    """Read the column names of a log.

    Args:
        path: a .csv or .parquet file.
        name: name of the file in messages.

    Raises:
        StudyError: the file is missing, too large, or not a log.
    """
    _check_file(path, name)
    if path.suffix == ".parquet":
        return tuple(_open_parquet(path, name).schema_arrow.names)
    with path.open("rb") as file:
        line = file.readline(_MAX_HEADER)
    try:
        text = line.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise StudyError(f"{name} is not UTF-8 text, which a CSV file must be") from error
    if not text.strip():
        raise StudyError(f"{name} is empty; a log begins with one line of column names")
    try:
        names = tuple(cell.strip() for cell in next(csv.reader(StringIO(text))))
    except csv.Error as error:
        raise StudyError(f"{name} has no line of column names: {error}") from error
    for separator in (";", "\t"):
        if len(names) == 1 and separator in text:
            raise StudyError(f"the columns of {name} are separated by {separator!r}; use commas")
    return names


def read_table(path: Path, name: str, columns: tuple[str, ...]) -> Table:
    """Read columns of a log.

    Args:
        path: a .csv or .parquet file.
        name: name of the file in messages.
        columns: names of columns; each must occur once in the header.

    Raises:
        StudyError: the file is missing, too large or damaged, or a cell is not a number.
    """
    header = read_header(path, name)
    for column in columns:
        if header.count(column) > 1:
            raise StudyError(f"{name} has {header.count(column)} columns named {column!r}")
    if path.suffix == ".parquet":
        table, first = _read_parquet(path, name, columns), 1
    else:
        table, first = _read_csv(path, name, header, columns), 2
    if table.num_rows == 0:
        raise StudyError(f"{name} has column names but no rows")
    values = {
        column: _numbers(table.column(i), name, column, first) for i, column in enumerate(columns)
    }
    return Table(name, values, first)


def _location(name: str, first: int, row: int) -> str:
    return f"{'line' if first == 2 else 'row'} {row + first} of {name}"


def _check_file(path: Path, name: str) -> None:
    if path.suffix not in (".csv", ".parquet"):
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


def _read_csv(path: Path, name: str, header: tuple[str, ...], columns: tuple[str, ...]) -> pa.Table:
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
        row, last = uneven[0], table.num_rows + len(uneven) + 1
        short = row.actual_columns < row.expected_columns and row.number == last
        raise StudyError(
            f"line {row.number} of {name} has {row.actual_columns} cells, the header "
            f"{row.expected_columns}" + ("; the file looks truncated" if short else "")
        )
    return table


def _parse_csv(
    data: bytes,
    header: tuple[str, ...],
    columns: tuple[str, ...],
    kind: pa.DataType,
    note: Callable[[pyarrow.csv.InvalidRow], str] | None = None,
) -> pa.Table:
    """Parse columns of one type; rows of another length go to ``note``, or are an error."""
    wanted = [str(header.index(column)) for column in columns]
    return pyarrow.csv.read_csv(
        pa.BufferReader(data),
        read_options=pyarrow.csv.ReadOptions(
            use_threads=False, skip_rows=1, column_names=[str(i) for i in range(len(header))]
        ),
        parse_options=pyarrow.csv.ParseOptions(ignore_empty_lines=False, invalid_row_handler=note),
        convert_options=pyarrow.csv.ConvertOptions(
            include_columns=wanted,
            column_types=dict.fromkeys(wanted, kind),
            null_values=[""],
            strings_can_be_null=True,
        ),
    )


def _numbers(cells: pa.ChunkedArray, name: str, column: str, first: int) -> Floats:
    if pa.types.is_binary(cells.type) or pa.types.is_string(cells.type):
        numbers = _parse_cells(cells.to_pylist(), name, column, first)
        empty = np.isnan(numbers)
    else:
        try:
            floats = pc.cast(cells, pa.float64())
        except pa.ArrowException as error:
            raise StudyError(
                f"column {column!r} of {name} holds {cells.type} instead of numbers"
            ) from error
        numbers = np.array(floats.to_numpy(), dtype=np.float64)
        empty = pc.is_null(cells).to_numpy().astype(bool)
    wrong = np.flatnonzero(~(np.abs(numbers) <= LARGEST) & ~empty)
    if len(wrong):
        raise _no_number(name, column, first, int(wrong[0]), str(numbers[wrong[0]]))
    return numbers


def _parse_cells(cells: list[bytes | str | None], name: str, column: str, first: int) -> Floats:
    """Convert text cells to floats; NaN where a cell is empty."""
    numbers = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        text = cell.decode("utf-8", "replace") if isinstance(cell, bytes) else cell or ""
        if not text.strip():
            continue
        try:
            numbers[row] = float(text)
        except ValueError as error:
            raise _no_number(name, column, first, row, text) from error
        if not abs(numbers[row]) <= LARGEST:
            raise _no_number(name, column, first, row, text)
    return numbers


def _no_number(name: str, column: str, first: int, row: int, text: str) -> StudyError:
    shown = text.strip() if len(text) < 40 else text.strip()[:40] + "..."
    return StudyError(
        f"{_location(name, first, row)}, column {column!r}: {shown!r} is not a number; leave the "
        "cell empty where nothing was measured"
    )
