"""Cells of a log: converts columns of numbers, text, times or lists to numbers.

Text may be a number, a time in ISO 8601 such as ``2024-05-01T12:00:00.020`` (UTC if it has no
zone), which becomes seconds since 1970, or a list of numbers such as ``[0.1, 0.2]``.
"""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from reality_gap.errors import StudyError
from reality_gap.io.dates import is_iso, iso_seconds
from reality_gap.types import Floats

LARGEST = 1e30
"""Largest magnitude of a number; its square is still finite."""

Location = Callable[[int], str]
"""Place of a row for messages."""

_LIST = re.compile(r"\s*[\[(](.*)[\])]\s*", re.DOTALL)


def size_of_list(text: str) -> int | None:
    """Return the number of numbers in a cell that holds a list; None if it holds none."""
    found = _LIST.fullmatch(text)
    return None if found is None else len(_parts(found[1]))


def numbers(cells: pa.ChunkedArray, name: str, column: str, location: Location) -> Floats:
    """Convert cells to numbers, shape (n,); NaN where a cell is empty.

    Args:
        cells: the cells of a column.
        name: name of the file in messages.
        column: name of the column in messages.
        location: place of a row for messages.

    Raises:
        StudyError: a cell is not a number.
    """
    if _is_text(cells):
        found = _parse_cells(cells.to_pylist(), column, location)
        empty = np.isnan(found)
    else:
        try:
            if pa.types.is_timestamp(cells.type):
                whole = pc.cast(pc.cast(cells, pa.timestamp("ns")), pa.int64())
                floats = pc.multiply(pc.cast(whole, pa.float64(), safe=False), 1e-9)
            else:
                floats = pc.cast(cells, pa.float64())
        except pa.ArrowException as error:
            raise StudyError(
                f"column {column!r} of {name} holds {cells.type} instead of numbers"
            ) from error
        found = np.array(floats.to_numpy(), dtype=np.float64)
        empty = pc.is_null(cells).to_numpy().astype(bool)
    wrong = np.flatnonzero(~(np.abs(found) <= LARGEST) & ~empty)
    if len(wrong):
        raise _no_number(column, location(int(wrong[0])), str(found[wrong[0]]))
    return found


def lists(cells: pa.ChunkedArray, size: int, column: str, location: Location) -> Floats:
    """Convert cells that hold lists to numbers, shape (n, size); NaN where a cell is empty.

    Args:
        cells: the cells of a column.
        size: number of numbers in each cell.
        column: name of the column in messages.
        location: place of a row for messages.

    Raises:
        StudyError: a cell is no list of that many numbers.
    """
    found = np.full((cells.length(), size), np.nan)
    for row, cell in enumerate(cells.to_pylist()):
        if cell is None:
            continue
        if isinstance(cell, bytes | str):
            text = _text(cell)
            if not text.strip():
                continue
            listed = _LIST.fullmatch(text)
            parts: list[object] = [] if listed is None else list(_parts(listed[1]))
        else:
            text, parts = str(cell), list(cell)
        try:
            values = np.array([np.nan if p is None else float(str(p)) for p in parts])
        except ValueError as error:
            raise _no_number(column, location(row), text) from error
        if len(values) != size or (np.abs(values) > LARGEST).any():
            raise StudyError(
                f"{location(row)}, column {column!r}: {_shown(text)} is no list of {size} numbers, "
                "as in the first row"
            )
        found[row] = values
    return found


def _parts(text: str) -> list[str]:
    """Return the parts of a list, which commas or blanks separate."""
    return re.split(r"\s*,\s*|\s+", text.strip().rstrip(",")) if text.strip() else []


def _is_text(cells: pa.ChunkedArray) -> bool:
    kind = cells.type
    return bool(
        pa.types.is_binary(kind) or pa.types.is_string(kind) or pa.types.is_large_string(kind)
    )


def _text(cell: bytes | str) -> str:
    return cell.decode("utf-8", "replace") if isinstance(cell, bytes) else cell


def _parse_cells(cells: list[bytes | str | None], column: str, location: Location) -> Floats:
    """Convert text cells to floats; NaN where a cell is empty."""
    found = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        text = _text(cell or "")
        if not text.strip():
            continue
        try:
            found[row] = iso_seconds(text) if is_iso(text) else float(text)
        except ValueError as error:
            raise _no_number(column, location(row), text) from error
        if not abs(found[row]) <= LARGEST:
            raise _no_number(column, location(row), text)
    return found


def _no_number(column: str, location: str, text: str) -> StudyError:
    return StudyError(
        f"{location}, column {column!r}: {_shown(text)} is not a number; leave the cell empty "
        "where nothing was measured"
    )


def _shown(text: str) -> str:
    return repr(text.strip() if len(text) < 40 else text.strip()[:40] + "...")
