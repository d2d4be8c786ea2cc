"""Column guesses: which column of a log belongs to which element of a model."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from functools import cache, lru_cache

import numpy as np

from reality_gap.io.column_names import (
    ALL_HINTS,
    ELECTRIC,
    HINTS,
    LOOSE,
    MEASURED,
    ending_of,
    kind_of,
    kind_of_unit,
    kind_of_words,
    quantity_of_words,
    words_of,
)

COMMON = frozenset(["joint", "motor", "servo", "actuator", "axis"])
"""Words of an element's name that do not say which one it is."""
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
        moved: name of the joint or tendon that an actuator moves, for this actuator and for
            sensors of its force; empty without one.
    """

    name: str
    target: str
    kind: str
    count: int = 1
    quantity: str = ""
    family: str = ""
    added: bool = False
    moved: str = ""


Found = dict[Element, tuple[str, ...]]
"""Columns of each element that has some."""
Pair = tuple[tuple[float, ...], Element, tuple[str, ...]]
"""A key to sort by, an element and columns that may belong to it."""
Silent = Callable[[str], frozenset[str]]
"""Returns the words of a column's name that state no kind."""


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
    silent = silent_words(elements)
    commands = [element for element in elements if element.kind == "command"]
    readings = [element for element in elements if element.kind != "command"]
    named = {name for element in elements for name in (element.name, element.target)}
    others = [column for column in columns if column not in named]
    _assign_stated(found, commands, columns, others, silent)
    # An actuator named "knee_torque" may have that as its column, if no other column fits.
    stating = [e for e in commands if kind_of(e.name, silent(e.name) | _own_silent(e))]
    _assign(found, [((), e, (e.name,)) for e in stating if e.name in columns])
    _assign_stated(found, readings, columns, others, silent)
    kinds = {element.kind for element in found}
    readings_first = "command" in kinds or ("force" in kinds and "position" not in kinds)
    for some in (readings, commands) if readings_first else (commands, readings):
        _assign(found, _unstated_pairs(some, columns, silent))
    _pair_last(found, elements, columns, silent)
    return found


def named_share(element: Element, column: str) -> float:
    """Return the fraction of an element's words in a column's name; 0 if these are only numbers.

    The words are those of the element's name, of its target or of what its actuator moves,
    whichever share is the largest. A column that was assigned by its number or by its order has 0.
    """
    names = (element.name, element.target, element.moved)
    return max(_share(_identity(name), column) for name in names)


def silent_words(elements: Iterable[Element]) -> Silent:
    """Return a function that returns the words of a column's name that state no kind.

    These are `LOOSE` words of an element whose whole name is in that of the column: the "l" of
    "l_hip" states no length where a joint has that name.
    """
    names = {pair for e in elements for pair in _silent_names(e) if pair[1] and len(pair[0]) > 1}

    @cache
    def silent(column: str) -> frozenset[str]:
        words = frozenset(words_of(column))
        return frozenset().union(*(some for name, some in names if name <= words))

    return silent


@lru_cache(maxsize=4096)
def _own_silent(element: Element) -> frozenset[str]:
    """Return the `LOOSE` words in the names of an element, which state nothing on its columns."""
    return frozenset().union(*(some for _, some in _silent_names(element)))


@lru_cache(maxsize=4096)
def _silent_names(element: Element) -> tuple[tuple[frozenset[str], frozenset[str]], ...]:
    """Return the words of each name of an element, and those `LOOSE` ones that state nothing.

    The "u" of an actuator "u_hip" states a command, unless the joint has it in its name, too.
    """
    names = (element.name, element.target, element.moved)
    name, target, moved = (frozenset(words_of(n)) for n in names)
    command = HINTS["command"] if element.moved else frozenset()
    stating = command | HINTS.get(element.kind, frozenset())
    return (
        (name, name & LOOSE - stating),
        (target, target & LOOSE - command),
        (moved, moved & LOOSE),
    )


def _assign(found: Found, pairs: Iterable[Pair]) -> None:
    """Add pairs of elements and columns that are both free, those of the largest keys first."""
    used = {column for group in found.values() for column in group}
    for _, element, group in sorted(pairs, key=lambda pair: pair[0], reverse=True):
        if element not in found and not used.intersection(group):
            found[element] = group
            used.update(group)


def _assign_stated(
    found: Found,
    elements: Sequence[Element],
    columns: Sequence[str],
    others: Sequence[str],
    silent: Silent,
) -> None:
    """Assign columns whose names state a kind.

    The number in "action.1" may count from 0, so that an element whose name is only a number, such
    as "q_1", has the column of that number only if numbers do not fit in their order.

    Args:
        found: columns that were assigned; those that are found are added.
        elements: elements that need columns.
        columns: names of all columns.
        others: those that are not also the name of an element.
        silent: words that state no kind.
    """
    words = [element for element in elements if not _is_number(_identity(_full(element)))]
    _assign(found, _stated_pairs(words, columns, silent))
    _number(found, elements, others, silent)
    _assign(found, _stated_pairs(elements, columns, silent))


def _stated_pairs(
    elements: Sequence[Element], columns: Sequence[str], silent: Silent
) -> Iterator[Pair]:
    """Yield the pairs of an element and columns whose names state its kind."""
    for i, element in enumerate(elements):
        for j, (label, group) in enumerate(_groups(columns, element.count)):
            if not _states(element, label, silent):
                continue
            similarity = _similarity(element, label) + 0.5
            if similarity >= _THRESHOLD:
                yield (similarity, -i, -j), element, group


def _unstated_pairs(
    elements: Sequence[Element], columns: Sequence[str], silent: Silent
) -> Iterator[Pair]:
    """Yield the pairs of an element and columns that state no kind, positions before others.

    Such a column is no force and no rate, unless the user's model has a sensor with that name.
    """
    for i, element in enumerate(elements):
        if _is_further(element):
            continue
        for j, (label, group) in enumerate(_groups(columns, element.count)):
            if _states(element, label, silent) is not False:
                continue
            similarity = _similarity(element, label)
            exact = 1.0 * (label == element.name) or 0.5 * (label == element.target)
            position = element.kind == "position"
            if similarity >= _THRESHOLD:
                yield (exact, position, similarity, -i, -j), element, group


def _number(
    found: Found, elements: Sequence[Element], columns: Sequence[str], silent: Silent
) -> None:
    """Pair elements of a kind in their order with columns such as action.0, action.1, ...

    Of several lists of columns that fit, one is taken if it is the only one that was `MEASURED`.
    """
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
                if 0 < len(some) == len(numbered) and all(_states(e, base, silent) for e in some)
            ]
            for i, base in pairs:
                alike = [pair for pair in pairs if pair[0] == i or pair[1] == base]
                measured = [pair for pair in alike if MEASURED.intersection(words_of(pair[1]))]
                taken = any(element in found for element in left[i])
                if not taken and [(i, base)] in (alike, measured):
                    ordered = zip(_in_order(left[i]), lists[base], strict=True)
                    found |= {element: (column,) for element, column in ordered}


def _in_order(elements: Sequence[Element]) -> list[Element]:
    """Return elements in the order of the numbers in their names; in theirs if these say none."""
    names = [_numbered(element) for element in elements]
    numbers = [int(match[2]) for match in names if match]
    same = {(match[1], match[3]) if match else None for match in names}
    if len(same) > 1 or len(set(numbers)) < len(elements):
        return list(elements)
    return [elements[i] for i in np.argsort(numbers)]


def _numbered(element: Element) -> re.Match[str] | None:
    """Return the only number in the name of an element or of its target, if there is one."""
    return re.fullmatch(r"(\D*)(\d+)(\D*)", element.target or element.name)


def _sets(elements: Sequence[Element]) -> Iterator[list[list[Element]]]:
    """Yield sets of elements that may be numbered together, those of the user's model first.

    These are all of them, those of one type, or those whose names differ in a number only.
    """
    own = [element for element in elements if not element.added]
    for some in (own, elements):
        yield [list(some)]
        families: dict[tuple[bool, str], list[Element]] = {}
        names: dict[tuple[str, ...], list[Element]] = {}
        for element in some:
            families.setdefault((element.added, element.family), []).append(element)
            match = _numbered(element)
            if match:
                names.setdefault((match[1], match[3], element.family), []).append(element)
        alike = list(families.values())
        yield alike + [group for group in names.values() if group not in alike]


def _lists(columns: Sequence[str]) -> dict[str, list[str]]:
    """Return the columns that end in numbers, in the order of these, by the rest of the name."""
    lists: dict[str, list[tuple[int, str]]] = {}
    for column in columns:
        match = _NUMBERED.fullmatch(column)
        if match:
            lists.setdefault(match[1], []).append((int(match[2]), column))
    return {base: [column for _, column in sorted(numbers)] for base, numbers in lists.items()}


def _pair_last(
    found: Found, elements: Sequence[Element], columns: Sequence[str], silent: Silent
) -> None:
    """Pair the last element of a kind with the last column that states its kind."""
    for kind in HINTS:
        used = {column for group in found.values() for column in group}
        left = [e for e in elements if e.kind == kind and e.count == 1 and e not in found]
        left = [e for e in left if not e.added] or left
        if len(left) != 1:
            continue
        stated = [c for c in columns if c not in used and _states(left[0], c, silent)]
        if len(stated) != 1:
            continue
        if not _is_further(left[0]) or ALL_HINTS.issuperset(words_of(stated[0])):
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
    identity = _identity(_full(element))
    both = identity & set(words_of(column))
    only_number = _is_number(both) and not _is_number(identity)
    only_common = _is_common(both) and not _is_common(identity)
    shared = len(both) / len(identity) if both and not (only_number or only_common) else 0.0
    # What the element belongs to may be in a name instead, but its own name is worth more.
    for weight, name in ((0.8, element.target), (0.6, element.moved)):
        other = _share(_identity(name), column)
        shared = max(shared, weight * other + (1.0 - weight) * shared)
    alike = SequenceMatcher(None, element.name.lower(), column.lower()).ratio()
    return 2.0 * shared + alike


def _states(element: Element, column: str, silent: Silent) -> bool | None:
    """Return whether a column's name states the kind of an element; None if it states another.

    Words that the element has in its own name state no other kind.
    """
    no_words = silent(column) | _own_silent(element)
    own_words = no_words.union(words_of(element.name))
    foreign = [word for word in words_of(column) if word not in own_words]
    if element.kind == "command":
        exerted = bool(ELECTRIC.intersection(foreign))
        quantity = quantity_of_words(foreign, loose=exerted)
        if quantity and element.quantity and quantity != element.quantity:
            return None
    if not element.kind:
        return None if kind_of_words(foreign, loose=False) else False
    if kind_of(column, no_words) == element.kind:
        return True
    own = ending_of(column) == ending_of(element.name)
    return None if kind_of_words(foreign) or (not own and kind_of_unit(column)) else False


def _share(identity: set[str], column: str) -> float:
    """Return the fraction of words that a column's name has; 0 if it has only common ones."""
    shared = identity.intersection(words_of(column))
    only = _is_number(shared) or (_is_common(shared) and not _is_common(identity))
    return 0.0 if only else len(shared) / len(identity)


def _is_common(words: Iterable[str]) -> bool:
    """Return whether many elements have such words, as "joint" and "1" of "wrist_1_joint"."""
    return _is_number(word for word in words if word not in COMMON)


def _full(element: Element) -> str:
    return f"{element.name} {element.target}"


def _is_number(words: Iterable[str]) -> bool:
    return all(word.isdecimal() for word in words)


def _identity(name: str) -> set[str]:
    """Return the words of a name that state no kind; all of them if there are no others."""
    words = set(words_of(name))
    return words - ALL_HINTS or words
