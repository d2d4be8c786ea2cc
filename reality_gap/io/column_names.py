"""Column names: what their words and units state about the columns of a log."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
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
        "desired des d demand demanded requested set setpoint sp sv goal u activation excitation "
        "soll sollwert",
        "position": "length len l pos position angle q theta encoder enc measured meas actual "
        "state feedback fb fbk pv ist istwert winkel",
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
MEASURED = frozenset(
    ["measured", "meas", "actual", "state", "feedback", "fb", "fbk", "pv", "ist", "istwert"]
)
"""Words that state that a column was measured; without others, that it is a position."""
LOOSE = (
    HINTS["time"]
    | MEASURED
    | {"l", "q", "f", "u", "d", "enc", "encoder", "load", "current", "moment"}
)
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

ELECTRIC = frozenset(["current", "moment"])
"""Words of what a motor exerts: without others, columns of them are no positions."""

ALL_HINTS = frozenset().union(*HINTS.values())
"""Words that state a kind and are no part of what an element is called."""


@lru_cache(maxsize=4096)
def kind_of(column: str, silent: frozenset[str] = frozenset()) -> str:
    """Return the kind of quantity that a column's name states, as in `HINTS`; empty if none.

    Args:
        column: name of the column.
        silent: words that state nothing.
    """
    words = [word for word in words_of(column) if word not in silent]
    return kind_of_words(words) or kind_of_unit(column)


def guess_time(columns: Iterable[str]) -> str | None:
    """Return the column that most likely holds the time: the shortest name that indicates it."""
    likely = [c for c in columns if HINTS["time"] & set(words_of(c))]
    return min(likely, key=lambda c: len(words_of(c)), default=None)


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
        unit = parse_unit(ending_of(column))
    except StudyError:
        return None
    return unit.symbol if unit.si in units and unit.symbol in symbols_of(unit.si) else None


def kind_of_words(words: Sequence[str], loose: bool = True) -> str:
    """Return the kind that words state, as in `HINTS`; empty if none.

    Args:
        words: words as `words_of` returns them.
        loose: whether `LOOSE` words count.
    """
    # Commands come first: the reference of a position is a command.
    stated = (kind for kind in ("other", "command") if HINTS[kind].intersection(words))
    return next(stated, "") or quantity_of_words(words, loose)


def quantity_of_words(words: Sequence[str], loose: bool = True) -> str:
    """Return the quantity that the last word with one states, or else a `LOOSE` one."""
    firm = [word for word in words if word not in LOOSE]
    kinds = [kind for word in firm for kind in QUANTITIES if word in HINTS[kind]]
    if kinds or not loose:
        return kinds[-1] if kinds else ""
    # An actual current is a force, but a current state is a position.
    stated = [word for word in words if word not in MEASURED or "state" in words]
    found = [
        kind for some in (stated, words) for kind in QUANTITIES if HINTS[kind].intersection(some)
    ]
    return found[0] if found else ""


def kind_of_unit(column: str) -> str:
    """Return the kind of quantity of the unit at the end of a name; empty without one."""
    unit = named_unit(column, KINDS)
    return KINDS[parse_unit(unit).si] if unit else ""


def ending_of(column: str) -> str:
    """Return the end of a name where a unit may be, such as "mm" of "length [mm]"."""
    return re.split(r"[_\s\[(]", column.rstrip(")] "))[-1]


@lru_cache(maxsize=4096)
def words_of(name: str) -> tuple[str, ...]:
    """Return the words of a name in lower case; those of `HINTS` in the singular."""
    spaced = re.sub(r"([a-z0-9])([A-Z])|([A-Z])([A-Z][a-z])", r"\1\3 \2\4", name)
    return tuple(_singular(word.lower()) for word in re.split(r"[^A-Za-z0-9]+", spaced) if word)


def _singular(word: str) -> str:
    forms = (word, word.removesuffix("s"), re.sub("ies$", "y", word)) if len(word) > 3 else (word,)
    return next((form for form in forms if form in ALL_HINTS), word)
