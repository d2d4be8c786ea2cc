"""Column names: guesses which column of a log belongs to which element of a model."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from functools import lru_cache

import numpy as np

from reality_gap.errors import StudyError
from reality_gap.io.units import parse_unit, symbols_of
from reality_gap.types import Floats

HINTS: dict[str, frozenset[str]] = {
    kind: frozenset(words.split())
    for kind, words in {
        "other": "error err deviation mode status flag temperature temp kp ki kd",
        "command": "target targeted action command commanded cmd ctrl control ref reference "
        "desired des demand demanded requested setpoint goal u activation excitation soll sollwert",
        "position": "length len l pos position angle q theta encoder enc measured meas actual "
        "state feedback ist istwert winkel",
        "rate": "vel velocity speed rate dq qd omega gyro",
        "force": "tension force torque load effort f tau current moment drehmoment kraft",
        "acceleration": "acceleration accel acc ddq qdd",
        "time": "t time timestamp stamp clock sec secs seconds millis milliseconds micros "
        "microseconds elapsed zeit",
    }.items()
}
"""Words in a column's name, by the kind of quantity that they indicate.

Plurals indicate the same. A column of kind "other" is no reading and no command.
"""

QUANTITIES = ("position", "rate", "force", "acceleration", "time")
"""Kinds that commands may have, too: a column may be the command of a position."""
_WORDS = "l q f u enc encoder load current moment measured meas actual state feedback ist istwert"
LOOSE = HINTS["time"] | frozenset(_WORDS.split())
"""Words that indicate a quantity only where no other word does, as in "actual_velocity"."""

KINDS = {
    unit: kind
    for kind, units in {
        "position": ("m", "rad"),
        "rate": ("m/s", "rad/s"),
        "force": ("N", "N m"),
        "acceleration": ("m/s^2", "rad/s^2"),
    }.items()
    for unit in units
}
"""Kind of quantity, as in `HINTS`, by SI unit."""

FAST, SLOW, SHORT = 0.5, 2.0, 2.0
"""Periods up to which the rows of a log follow each other: `FAST` [s], or `SLOW` [s] if with the
next smaller unit the log would be shorter than `SHORT` [s]."""

_HINTS = frozenset().union(*HINTS.values())
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
        quantity: one of `QUANTITIES` in which a command is; empty if it is unknown.
        family: type of the element; numbered columns belong to the elements of one type.
        added: whether the user's model lacks the element. It has columns that are left only.
    """

    name: str
    target: str
    kind: str
    count: int = 1
    quantity: str = ""
    family: str = ""
    added: bool = False


Found = dict[Element, tuple[str, ...]]
"""Columns of each element that has some."""
Pair = tuple[tuple[float, ...], Element, tuple[str, ...]]
"""A key to sort by, an element and columns that may belong to it."""


def guess(elements: Sequence[Element], columns: Sequence[str]) -> Found:
    """Assign columns to elements; each column is used at most once.

    A column whose name states a kind of quantity belongs to an element of that kind. Such columns
    are assigned first, by their names or else by their numbers. Columns that state no kind follow:
    where commands are stated to be commands, the others are readings, if they can be.

    Args:
        elements: all elements that the columns may belong to.
        columns: names of the columns.
    """
    found: Found = {}
    commands = [element for element in elements if element.kind == "command"]
    readings = [element for element in elements if element.kind != "command"]
    named = {name for element in elements for name in (element.name, element.target)}
    others = [column for column in columns if column not in named]
    _assign(found, _stated_pairs(commands, columns))
    _number(found, commands, others)
    # An actuator named "knee_torque" may have that as its column, if no other column fits.
    stating = [element for element in commands if kind_of(element.name)]
    _assign(found, [((), e, (e.name,)) for e in stating if e.name in columns])
    _assign(found, _stated_pairs(readings, columns))
    _number(found, readings, others)
    kinds = {element.kind for element in found}
    readings_first = "command" in kinds or ("force" in kinds and "position" not in kinds)
    for some in (readings, commands) if readings_first else (commands, readings):
        _assign(found, _unstated_pairs(some, columns))
    _pair_last(found, elements, columns)
    return found


@lru_cache(maxsize=4096)
def kind_of(column: str) -> str:
    """Return the kind of quantity that a column's name states, as in `HINTS`; empty if none."""
    return _kind(_words(column)) or _kind_of_unit(column)


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
    try:
        unit = parse_unit(_ending(column))
    except StudyError:
        return None
    return unit.symbol if unit.si in units and unit.symbol in symbols_of(unit.si) else None


def named_share(element: Element, column: str) -> float:
    """Return the fraction of an element's words in a column's name; 0 if these are only numbers.

    The words are those of the element's name or those of its target, whichever share is larger.
    A column that was assigned by its number or by its order has 0.
    """
    words = set(_words(column))
    shares = [0.0]
    for identity in (_identity(element.name), _identity(element.target)):
        shared = identity & words
        if not all(word.isdecimal() for word in shared):
            shares.append(len(shared) / len(identity))
    return max(shares)


def _assign(found: Found, pairs: Iterable[Pair]) -> None:
    """Add pairs of elements and columns that are both free, those of the largest keys first."""
    used = {column for group in found.values() for column in group}
    for _, element, group in sorted(pairs, key=lambda pair: pair[0], reverse=True):
        if element not in found and not used.intersection(group):
            found[element] = group
            used.update(group)


def _stated_pairs(elements: Sequence[Element], columns: Sequence[str]) -> Iterator[Pair]:
    """Yield the pairs of an element and columns whose names state its kind."""
    for i, element in enumerate(elements):
        for j, (label, group) in enumerate(_groups(columns, element.count)):
            if not _states(element, label):
                continue
            similarity = _similarity(element, label) + 0.5
            if similarity >= _THRESHOLD:
                yield (similarity, -i, -j), element, group


def _unstated_pairs(elements: Sequence[Element], columns: Sequence[str]) -> Iterator[Pair]:
    """Yield the pairs of an element and columns that state no kind, positions before others.

    Such a column is no force and no rate, unless the user's model has a sensor with that name.
    """
    for i, element in enumerate(elements):
        if _is_further(element):
            continue
        for j, (label, group) in enumerate(_groups(columns, element.count)):
            if _states(element, label) is not False:
                continue
            similarity = _similarity(element, label)
            exact, position = label == element.name, element.kind == "position"
            if similarity >= _THRESHOLD:
                yield (exact, position, similarity, -i, -j), element, group


def _number(found: Found, elements: Sequence[Element], columns: Sequence[str]) -> None:
    """Pair elements of a kind in their order with columns such as action.0, action.1, ..."""
    for kind in dict.fromkeys(element.kind for element in elements if element.kind):
        every = [e for e in elements if e.kind == kind and e.count == 1]
        for sets in _sets(every):
            left = [[e for e in some if e not in found] for some in sets]
            used = {column for group in found.values() for column in group}
            lists = _lists([column for column in columns if column not in used])
            pairs = [
                (i, base)
                for i, some in enumerate(left)
                for base, numbered in lists.items()
                if 0 < len(some) == len(numbered) and all(_states(e, base) for e in some)
            ]
            for i, base in pairs:
                alike = [pair for pair in pairs if pair[0] == i or pair[1] == base]
                if len(alike) == 1:
                    found |= {e: (c,) for e, c in zip(left[i], lists[base], strict=True)}


def _sets(elements: Sequence[Element]) -> Iterator[list[list[Element]]]:
    """Yield sets of elements that may be numbered together, those of the user's model first."""
    own = [element for element in elements if not element.added]
    for some in (own, elements):
        yield [list(some)]
        families: dict[tuple[bool, str], list[Element]] = {}
        for element in some:
            families.setdefault((element.added, element.family), []).append(element)
        yield list(families.values())


def _lists(columns: Sequence[str]) -> dict[str, list[str]]:
    """Return the columns that end in numbers, in the order of these, by the rest of the name."""
    lists: dict[str, list[tuple[int, str]]] = {}
    for column in columns:
        match = _NUMBERED.fullmatch(column)
        if match:
            lists.setdefault(match[1], []).append((int(match[2]), column))
    return {base: [column for _, column in sorted(numbers)] for base, numbers in lists.items()}


def _pair_last(found: Found, elements: Sequence[Element], columns: Sequence[str]) -> None:
    """Pair the last element of a kind with the last column of that kind."""
    for kind in HINTS:
        used = {column for group in found.values() for column in group}
        left = [e for e in elements if e.kind == kind and e.count == 1 and e not in found]
        left = [e for e in left if not e.added] or left
        stated = [c for c in columns if c not in used and kind_of(c) == kind]
        if not (len(left) == len(stated) == 1 and _states(left[0], stated[0])):
            continue
        if not _is_further(left[0]) or _HINTS.issuperset(_words(stated[0])):
            found[left[0]] = (stated[0],)


def _is_further(element: Element) -> bool:
    """Return whether an element is a force or rate that the user's model does not measure."""
    return element.added and element.kind in ("force", "rate")


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
    """Return the similarity of the names of an element and a column, 0 to 3."""
    identity = _identity(f"{element.name} {element.target}")
    shared = len(identity & set(_words(column))) / len(identity) if identity else 0.0
    alike = SequenceMatcher(None, element.name.lower(), column.lower()).ratio()
    return 2.0 * shared + alike


def _states(element: Element, column: str) -> bool | None:
    """Return whether a column's name states the kind of an element; None if it states another.

    Words that the element has in its own name state no other kind.
    """
    words = _words(column)
    foreign = [word for word in words if word not in _words(element.name)]
    if element.kind == "command":
        quantity = _quantity(foreign, loose=False)
        if quantity and element.quantity and quantity != element.quantity:
            return None
    if not element.kind:
        return None if _kind(foreign, loose=False) else False
    if kind_of(column) == element.kind:
        return True
    own = _ending(column) == _ending(element.name)
    return None if _kind(foreign) or (not own and _kind_of_unit(column)) else False


def _identity(name: str) -> set[str]:
    """Return the words of a name that state no kind; all of them if there are no others."""
    words = set(_words(name))
    return words - _HINTS or words


def _kind(words: Sequence[str], loose: bool = True) -> str:
    # Commands come first: the reference of a position is a command.
    stated = (kind for kind in ("other", "command") if HINTS[kind].intersection(words))
    return next(stated, "") or _quantity(words, loose)


def _quantity(words: Sequence[str], loose: bool = True) -> str:
    """Return the quantity that the last word with one states, or else a `LOOSE` one."""
    firm = [word for word in words if word not in LOOSE]
    kinds = [kind for word in firm for kind in QUANTITIES if word in HINTS[kind]]
    others = (kind for kind in QUANTITIES if loose and HINTS[kind].intersection(words))
    return kinds[-1] if kinds else next(others, "")


def _kind_of_unit(column: str) -> str:
    """Return the kind of quantity of the unit at the end of a name; empty without one."""
    unit = named_unit(column, KINDS)
    return KINDS[parse_unit(unit).si] if unit else ""


def _ending(column: str) -> str:
    return re.split(r"[_\s\[(]", column.rstrip(")] "))[-1]


@lru_cache(maxsize=4096)
def _words(name: str) -> tuple[str, ...]:
    """Return the words of a name in lower case; those of `HINTS` in the singular."""
    spaced = re.sub(r"([a-z0-9])([A-Z])", r"\1 \2", name)
    return tuple(_singular(word.lower()) for word in re.split(r"[^A-Za-z0-9]+", spaced) if word)


def _singular(word: str) -> str:
    forms = (word, word.removesuffix("s"), re.sub("ies$", "y", word)) if len(word) > 3 else (word,)
    return next((form for form in forms if form in _HINTS), word)
