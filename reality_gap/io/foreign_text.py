"""Foreign text: rewrites tables as other programs export them as CSV files that can be read.

Such tables may be in UTF-16 or Windows-1252, have other separators, decimal commas, lines above the
column names, a line of units below them, repeated column names, dates and times of day, words such
as NaN, and rows that were cut off. Each line keeps its number, so that messages name the right one.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Callable, Iterator, Sequence
from io import StringIO
from pathlib import Path
from typing import NamedTuple

from reality_gap.errors import StudyError, UnknownNameError
from reality_gap.io.dates import seconds_of
from reality_gap.io.units import parse_unit

TEXT = (".csv", ".tsv", ".txt", ".dat", ".asc")
"""Suffixes of tables of text, in lower case."""
SEPARATORS = (";", "\t", "|", ",", " ")
"""Separators of cells; a blank stands for any number of them."""
EMPTY = frozenset(
    ["nan", "na", "n/a", "#n/a", "null", "none", "inf", "-inf", "+inf", "infinity", "-", "--", "?"]
)
"""Words for what was not measured, in lower case."""
WORDS = {"true": "1", "false": "0", "on": "1", "off": "0"}
"""Words for numbers, in lower case."""
_MAX_PREAMBLE = 200  # largest number of lines above the column names
_SAMPLE = 200  # number of rows by which decimal commas and dates are recognised
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_COMMA = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?")

Note = Callable[[str], None]
"""Called with a sentence on what was guessed or left out."""


class _Layout(NamedTuple):
    """Layout of a table.

    Attributes:
        names: names of the columns.
        skipped: number of lines up to and with that of the names.
        separator: one of `SEPARATORS`.
    """

    names: tuple[str, ...]
    skipped: int
    separator: str


def rewrite(path: Path, new: Path, note: Note) -> None:
    """Rewrite a table of text as CSV with commas, in UTF-8.

    Args:
        path: the table.
        new: file to write.
        note: called with a sentence on what was guessed or left out.

    Raises:
        StudyError: no line of the file holds column names above rows of numbers.
    """
    lines = _decoded(path, note).replace("\r\n", "\n").replace("\r", "\n").split("\n")
    while lines and not lines[-1].strip():
        lines.pop()
    layout = _layout(lines, path.name)
    rows = [_split(line, layout.separator) for line in lines[layout.skipped :]]
    names, rows = _with_units(layout.names, rows)
    rows = _whole(rows, names, layout, path.name, note)
    if layout.separator != "," and _has_commas(rows):
        rows = [[cell.replace(",", ".") for cell in row] for row in rows]
        note(f"{path.name}: its numbers have decimal commas")
    columns = [list(column) for column in zip(*rows, strict=True)]
    columns = [_plain(column, name) for column, name in zip(columns, names, strict=True)]
    with new.open("w", newline="", encoding="utf-8") as file:
        file.write("#\n" * (layout.skipped - 1))
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(zip(*columns, strict=True))


def _decoded(path: Path, note: Note) -> str:
    data = path.read_bytes()
    for mark, name in (
        (codecs.BOM_UTF8, "utf-8-sig"),
        (codecs.BOM_UTF16_LE, "utf-16"),
        (codecs.BOM_UTF16_BE, "utf-16"),
    ):
        if data.startswith(mark):
            return data.decode(name, "replace")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        note(f"{path.name} is not UTF-8 text and was read as Windows-1252")
        return data.decode("cp1252", "replace")


def _split(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader(StringIO(line), delimiter=separator), [])]
    except csv.Error:
        return []


def _layout(lines: Sequence[str], name: str) -> _Layout:
    """Return the layout: the first line of names that has as many cells as the rows below it."""
    comment = ""
    for i, line in enumerate(lines[:_MAX_PREAMBLE]):
        commented = line.lstrip().startswith("#")
        names_line = line.lstrip().lstrip("#").strip() if commented else line
        below = [x for x in lines[i + 1 : i + 4] if x.strip()]
        for separator in SEPARATORS:
            names = _split(names_line, separator)
            rows = [_split(x, separator) for x in below]
            if len(names) > 1 and _fit(names, rows) and not any(map(is_value, names)):
                return _Layout(tuple(names), i + 1, separator)
        comment = comment or (names_line if commented else "")
    first = next((x for x in lines if x.strip()), "")
    if not first:
        raise StudyError(f"{name} is empty; a log begins with one line of column names")
    if any(is_value(cell) for s in SEPARATORS for cell in _split(first, s)):
        raise without_names(name)
    raise StudyError(
        f"no line of {name} holds column names above rows with as many cells; a log is a table of "
        "text with one line of column names"
    )


def _fit(names: Sequence[str], rows: Sequence[Sequence[str]]) -> bool:
    """Return whether the first of some rows is one of values, or the second below one of units."""
    whole = [len(row) == len(names) for row in rows[:2]]
    if not any(whole) or names[0].startswith("sep="):
        return False
    if whole[0] and any(map(is_value, rows[0])):
        return True
    units = whole[0] and any(map(_unit, rows[0]))
    return units and len(whole) > 1 and whole[1] and any(map(is_value, rows[1]))


def without_names(name: str) -> StudyError:
    """Return the error of a log without column names."""
    return StudyError(
        f"the first line of {name} holds numbers; a log needs a line of column names above them, "
        "such as time,cmd_elbow,q_elbow"
    )


def is_value(cell: str) -> bool:
    """Return whether a cell is a number, a date or a time of day."""
    return bool(
        _NUMBER.fullmatch(cell)
        or _COMMA.fullmatch(cell)
        or cell.startswith("[")
        or seconds_of(cell) is not None
    )


def _with_units(
    names: tuple[str, ...], rows: list[list[str]]
) -> tuple[tuple[str, ...], list[list[str]]]:
    """Append the units of a line below the names to these, and empty that line."""
    if not rows or len(rows[0]) != len(names) or any(map(is_value, rows[0])):
        return names, rows
    units = [_unit(cell) for cell in rows[0]]
    named = [f"{n} [{u}]" if u else n for n, u in zip(names, units, strict=True)]
    return tuple(named), [[""] * len(names), *rows[1:]]


def _unit(cell: str) -> str:
    """Return the symbol of a unit that a cell may hold in brackets; empty if it holds none."""
    try:
        return parse_unit(cell.strip("[]() ")).symbol
    except UnknownNameError:
        return ""


def _whole(
    rows: list[list[str]], names: tuple[str, ...], layout: _Layout, name: str, note: Note
) -> list[list[str]]:
    """Return the rows, without the cells of those that are no rows of the table."""
    empty, wrong, repeated = [""] * len(names), list[int](), 0
    found = []
    for i, row in enumerate(rows):
        whole = len(row) == len(names)
        if whole and tuple(row) != layout.names:
            found.append(row)
            continue
        found.append(empty)
        repeated += whole
        if not whole and any(row) and not row[0].startswith("#"):
            wrong.append(layout.skipped + 1 + i)
    if wrong:
        note(
            f"{name}: {len(wrong)} rows left out that do not have {len(names)} cells as the line "
            f"of names does, the first of them in line {wrong[0]}"
        )
    if repeated:
        note(f"{name}: the column names occur {repeated} more times, and were left out there")
    return found


def _has_commas(rows: Sequence[Sequence[str]]) -> bool:
    """Return whether numbers have decimal commas, and none a decimal point."""
    cells = [cell for row in rows[:_SAMPLE] for cell in row]
    points = any("." in cell and _NUMBER.fullmatch(cell) for cell in cells)
    return not points and any(map(_COMMA.fullmatch, cells))


def _plain(column: list[str], name: str) -> list[str]:
    """Return cells with numbers in place of dates, and nothing where nothing was measured."""
    known = ("" if c.lower() in EMPTY else WORDS.get(c.lower(), c) for c in column)
    cells = list(known)
    first = next((cell for cell in cells if cell), "")
    if not first or _NUMBER.fullmatch(first) or seconds_of(first) is None:
        return cells
    return list(_dated(cells))


def _dated(cells: Sequence[str]) -> Iterator[str]:
    """Yield dates and times of day as seconds; a time of day that falls begins the next day."""
    before, days = 0.0, 0
    for cell in cells:
        time = seconds_of(cell) if cell else None
        if time is None:
            yield cell
            continue
        if time < 86400.0 and before - time > 43200.0:
            days += 1
        before = time
        yield f"{time + 86400.0 * days:.6f}"
