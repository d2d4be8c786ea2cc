"""Headers of logs: names of columns, comments before them, and columns that hold lists."""

from __future__ import annotations

import csv
from io import StringIO
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa
import pyarrow.parquet

from reality_gap.errors import StudyError
from reality_gap.io.cells import size_of_list

COMMENT = b"#"
"""Start of a comment line above the line of column names."""
_MAX_HEADER = 1 << 20  # largest length of the line of column names [bytes]
_MAX_COMMENTS = 1000
_MAX_LIST = 1000  # largest number of numbers in a list


class Header(NamedTuple):
    """Names of the columns of a log.

    Attributes:
        raw: names of the columns in the file.
        sizes: number of numbers in each cell of the columns that hold lists.
        skipped: number of lines before the first row.
    """

    raw: tuple[str, ...]
    sizes: dict[str, int]
    skipped: int

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns of numbers; a list in ``q`` is the columns ``q.0``, ``q.1`` ..."""
        return tuple(
            name
            for raw in self.raw
            for name in (
                [f"{raw}.{i}" for i in range(self.sizes[raw])] if raw in self.sizes else [raw]
            )
        )

    def find(self, column: str) -> tuple[str, int | None]:
        """Return the column of the file that holds a column, and its place in a list or None."""
        raw, _, number = column.rpartition(".")
        if column not in self.raw and raw in self.sizes and number.isdecimal():
            return raw, int(number)
        return column, None


def csv_header(path: Path, name: str) -> Header:
    """Read the header of a CSV file.

    Lines of comment, which begin with #, may stand above the column names. The last of them holds
    the names if numbers follow, as ``numpy.savetxt`` writes it.

    Args:
        path: the file.
        name: name of the file in messages.

    Raises:
        StudyError: the file is empty, not text, or has no column names.
    """
    with path.open("rb") as file:
        line, comments = file.readline(_MAX_HEADER).removeprefix(b"\xef\xbb\xbf"), 0
        last = b""
        while line.lstrip().startswith(COMMENT) and comments < _MAX_COMMENTS:
            last = line.lstrip().lstrip(COMMENT)
            line, comments = file.readline(_MAX_HEADER), comments + 1
        if comments and _is_data(line):
            names = _names(last, name)
            return Header(names, _sizes(names, line), comments)
        names = _names(line, name)
        return Header(names, _sizes(names, file.readline(_MAX_HEADER)), comments + 1)


def parquet_header(file: pyarrow.parquet.ParquetFile) -> Header:
    """Read the header of a Parquet file.

    Raises:
        pyarrow.ArrowException: the file is damaged.
    """
    schema, sizes = file.schema_arrow, {}
    for column in schema:
        if isinstance(column.type, pa.FixedSizeListType):
            sizes[column.name] = column.type.list_size
        elif isinstance(column.type, pa.ListType | pa.LargeListType):
            for batch in file.iter_batches(batch_size=1, columns=[column.name], use_threads=False):
                first = batch.column(0)[0].as_py()
                sizes[column.name] = len(first or ())
                break
    known = {name: size for name, size in sizes.items() if 0 < size <= _MAX_LIST}
    return Header(tuple(schema.names), known, 0)


def _names(line: bytes, name: str) -> tuple[str, ...]:
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
            raise StudyError(
                f"the columns of {name} are separated by {separator!r}; use commas, "
                "or reality-gap run, which rewrites such a file"
            )
    return names


def _cells(line: bytes) -> list[str]:
    try:
        return next(csv.reader(StringIO(line.decode("utf-8", "replace"))), [])
    except csv.Error:
        return []


def _is_data(line: bytes) -> bool:
    """Return whether a line begins with a number, so that it names no columns."""
    cells = _cells(line)
    try:
        return bool(cells) and float(cells[0]) is not None
    except ValueError:
        return False


def _sizes(names: tuple[str, ...], line: bytes) -> dict[str, int]:
    """Return the sizes of the lists in the first row."""
    cells = _cells(line)
    if len(cells) != len(names):
        return {}
    found = {name: size_of_list(cell) for name, cell in zip(names, cells, strict=True)}
    return {name: size for name, size in found.items() if size and size <= _MAX_LIST}
