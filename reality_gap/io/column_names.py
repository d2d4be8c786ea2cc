"""Column names: guesses which column of a log belongs to which element of a model."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher

import numpy as np

from reality_gap.errors import StudyError
from reality_gap.io.units import parse_unit, symbols_of
from reality_gap.types import Floats

HINTS: dict[str, frozenset[str]] = {
    kind: frozenset(words.split())
    for kind, words in {
        "command": "target action command cmd ctrl control ref reference desired des setpoint "
        "goal u soll sollwert",
        "position": "length len l pos position angle q theta encoder enc measured meas state ist "
        "istwert winkel",
        "rate": "vel velocity speed rate dq qd omega gyro",
        "force": "tension force torque load effort f tau current moment drehmoment kraft",
        "time": "t time timestamp stamp clock sec secs seconds millis milliseconds micros "
        "microseconds elapsed zeit",
    }.items()
}
"""Words in a column's name, by the kind of quantity that they indicate."""

KINDS = {"m": "position", "rad": "position", "N": "force", "N m": "force"} | {
    "m/s": "rate",
    "rad/s": "rate",
}
"""Kind of quantity, as in `HINTS`, by SI unit."""

FAST, SLOW, SHORT = 0.5, 2.0, 2.0
"""Periods up to which the rows of a log follow each other: `FAST` [s], or `SLOW` [s] if with the
next smaller unit the log would be shorter than `SHORT` [s]."""

_THRESHOLD = 1.5  # smallest similarity of a guess
_COMPONENT = re.compile(r"(.*?)[_. ]?([wxyz])$")
_NUMBERED = re.compile(r"(.*?)[_. \[]?(\d+)\]?")


@dataclass(frozen=True)
class Element:
    """An element of the model that needs columns.

    Attributes:
        name: name of the sensor, actuator or joint.
        target: name of the element that a sensor measures; empty without one.
        kind: kind of quantity, as in `HINTS`; empty if it is none of these.
        count: number of columns.
    """

    name: str
    target: str
    kind: str
    count: int = 1


def guess(elements: Sequence[Element], columns: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Assign columns to elements, the most similar pairs first.

    Returns:
        Columns by the element's name; each column is used at most once.
    """
    free = dict.fromkeys(columns)
    pairs = [
        (_similarity(element, label), -i, -j, element, group)
        for i, element in enumerate(elements)
        for j, (label, group) in enumerate(_groups(columns, element.count))
    ]
    found: dict[str, tuple[str, ...]] = {}
    for similarity, _, _, element, group in sorted(pairs, key=lambda p: p[:3], reverse=True):
        if similarity < _THRESHOLD or element.name in found or any(c not in free for c in group):
            continue
        found[element.name] = group
        for column in group:
            del free[column]
    found |= _numbered(elements, found, list(free))
    free = {c: None for c in free if not any(c in group for group in found.values())}
    return found | _remaining_pairs(elements, found, list(free))


def guess_time(columns: Iterable[str]) -> str | None:
    """Return the column that most likely holds the time: the shortest name that indicates it."""
    likely = [c for c in columns if HINTS["time"] & set(_words(c))]
    return min(likely, key=lambda c: len(_words(c)), default=None)


def guess_time_unit(time: Floats) -> str:
    """Return the unit that a time most likely has: s, ms, us or ns, from its steps and duration.

    Steps of 1 may be seconds or milliseconds; the former if the log would else be too short.

    Args:
        time: cells of the column, shape (n,); NaN where a cell is empty.
    """
    time = time[np.isfinite(time)]
    steps = np.diff(time)
    steps = steps[steps > 0.0]
    usual, duration = (float(np.median(steps)), float(np.sum(steps))) if len(steps) else (0.0, 0.0)
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        slow = usual * size < SLOW and duration * size / 1e3 < SHORT
        if usual * size < FAST or slow:
            return unit
    return "ns"


def named_unit(column: str, units: Iterable[str]) -> str | None:
    """Return the unit at the end of a column's name, as in "length_mm".

    Args:
        column: name of the column.
        units: SI units that are valid.

    Returns:
        The unit's symbol; None if the name ends in no unit, or in one of another dimension.
    """
    ending = re.split(r"[_\s\[(]", column.rstrip(")] "))[-1]
    try:
        unit = parse_unit(ending)
    except StudyError:
        return None
    return unit.symbol if unit.si in units and unit.symbol in symbols_of(unit.si) else None


def named_share(element: Element, column: str) -> float:
    """Return the fraction of an element's words in a column's name; 0 if these are only numbers.

    A column that was assigned by its number or by its order has 0.
    """
    hints = frozenset().union(*HINTS.values())
    identity = set(_words(f"{element.name} {element.target}")) - hints
    shared = identity & set(_words(column))
    return 0.0 if all(word.isdecimal() for word in shared) else len(shared) / len(identity)


def _numbered(
    elements: Sequence[Element], found: dict[str, tuple[str, ...]], free: list[str]
) -> dict[str, tuple[str, ...]]:
    """Pair elements of a kind in their order with columns such as action.0, action.1, ..."""
    pairs: dict[str, tuple[str, ...]] = {}
    for kind in dict.fromkeys(element.kind for element in elements if element.kind):
        left = [e.name for e in elements if e.kind == kind and e.count == 1 and e.name not in found]
        lists: dict[str, list[tuple[int, str]]] = {}
        for column in free:
            match = _NUMBERED.fullmatch(column)
            if match and _kind(match[1]) == kind:
                lists.setdefault(match[1], []).append((int(match[2]), column))
        fitting = [sorted(columns) for columns in lists.values() if len(columns) == len(left)]
        if len(fitting) == 1:
            pairs |= {name: (c,) for name, (_, c) in zip(left, fitting[0], strict=True)}
    return pairs


def _remaining_pairs(
    elements: Sequence[Element], found: dict[str, tuple[str, ...]], free: list[str]
) -> dict[str, tuple[str, ...]]:
    """Pair the last element of a kind with the last column of that kind."""
    pairs: dict[str, tuple[str, ...]] = {}
    for kind in HINTS:
        left = [e for e in elements if e.kind == kind and e.count == 1 and e.name not in found]
        hinted = [column for column in free if _kind(column) == kind]
        if len(left) == len(hinted) == 1:
            pairs[left[0].name] = (hinted[0],)
    return pairs


def _groups(columns: Sequence[str], count: int) -> list[tuple[str, tuple[str, ...]]]:
    """Return groups of ``count`` columns: the common part of their names, and the columns."""
    if count == 1:
        return [(column, (column,)) for column in columns]
    axes = {3: "xyz", 4: "wxyz"}.get(count)
    if axes is None:
        return []
    parts: dict[str, dict[str, str]] = {}
    for column in columns:
        match = _COMPONENT.match(column)
        if match:
            parts.setdefault(match[1], {})[match[2]] = column
    return [
        (base, tuple(part[axis] for axis in axes))
        for base, part in parts.items()
        if set(part) == set(axes)
    ]


def _similarity(element: Element, column: str) -> float:
    """Return the similarity of an element and a column, about 0 to 4."""
    if column == element.name:
        return 4.0
    words = set(_words(column))
    hints = frozenset().union(*HINTS.values())
    identity = set(_words(f"{element.name} {element.target}")) - hints
    shared = len(identity & words) / len(identity) if identity else 0.0
    alike = SequenceMatcher(None, element.name.lower(), column.lower()).ratio()
    kind = _kind(column)
    fits = 0.0 if not kind or not element.kind else (0.5 if kind == element.kind else -1.5)
    return 2.0 * shared + alike + fits


def _kind(column: str) -> str:
    words = set(_words(column))
    # Commands come first: the reference of a position is a command.
    return next((kind for kind, hints in HINTS.items() if hints & words), "")


def _words(name: str) -> list[str]:
    spaced = re.sub(r"([a-z0-9])([A-Z])", r"\1 \2", name)
    return [word.lower() for word in re.split(r"[^A-Za-z0-9]+", spaced) if word]
