"""Numbers in a message, each with the path of fields and names that lead to it.

What has a name keeps it, wherever it stands in an array: joints, frames, markers. So the same
column never holds two things in turn.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, NamedTuple, cast

import numpy as np

MAX_ELEMENTS = 256
"""Largest number of elements of an array; longer ones are images, point clouds or maps."""
LABELS = ("name", "names", "joint_names", "interface_names")
"""Fields that name the elements of a message's arrays, besides those that end in ``_names``."""
NUMBERS = ("ids", "marker_ids", "tag_ids")
"""Fields that number the elements of a message's arrays."""
IDENTITIES = (
    *("frame_id", "parent_frame_id", "child_frame_id", "ns", "name", "joint_name", "link_name"),
    *("frame", "id", "marker_id", "tag_id"),
)
"""Fields that say what a message is about."""
HEADER = "std_msgs/msg/Header"
TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
_NUMBER = int | float | np.number | np.bool_
_TIME_FIELDS = (("sec", "nanosec"), ("sec", "nsec"), ("secs", "nsecs"), ("seconds", "nanos"))

Path = tuple[str, ...]
"""Names of fields, and names or numbers of elements, that lead to a number."""
Node = dict[str, Any]
"""Fields of a message by name."""


class Entry(NamedTuple):
    """Numbers of one time.

    Attributes:
        stamp: time stamp by the sender [ns]; None without one.
        identity: what the numbers are about, such as the frames of a transform.
        cells: numbers by path.
    """

    stamp: int | None
    identity: Path
    cells: dict[Path, float]


class Reader:
    """Reads the numbers of a topic's messages.

    Attributes:
        counts: smallest and largest number of elements without names, by the array's path.
        misfits: number of names that a message lists, and number of elements of an array of
            numbers that is of another size, by the array's path.
    """

    def __init__(self) -> None:
        self.counts: dict[Path, tuple[int, int]] = {}
        self.misfits: dict[Path, tuple[int, int]] = {}

    def entries(self, message: Any) -> list[Entry]:
        """Return the numbers of a message, apart for each of its time stamps."""
        top = _node(message)
        if top is None:
            return [Entry(None, (), dict(self._numbers((), message, ())))]
        stamp = _stamp(top)
        identity = () if _labels(top) else _identity(top, numbered=False)
        rest = dict(self._fields((), top, ()))
        if stamp is not None:
            return [Entry(stamp, identity, rest)]
        stamps = _stamps_of_elements(top)
        found: dict[int | None, dict[Path, float]] = {}
        for path, number in rest.items():
            found.setdefault(stamps.get(path[:2]), {})[path] = number
        return [Entry(when, identity, cells) for when, cells in found.items()]

    def _fields(self, path: Path, node: Node, names: Sequence[str]) -> Iterator[tuple[Path, float]]:
        own = _labels(node) or names
        for name, value in node.items():
            if not (_is_header(name, value) or (name == "timestamp" and _time(value) is not None)):
                yield from self._numbers((*path, name), value, own)

    def _numbers(
        self, path: Path, value: Any, names: Sequence[str]
    ) -> Iterator[tuple[Path, float]]:
        """Yield path and number of all numbers in a value."""
        if isinstance(value, _NUMBER):
            yield path, _float(value)
        elif (time := _time(value)) is not None:
            yield path, 1e-9 * time
        elif (node := _node(value)) is not None:
            yield from self._fields(path, node, names)
        elif isinstance(value, list | np.ndarray) and len(value) <= MAX_ELEMENTS:
            ends = self._ends(path, value, names)
            for end, element in zip(ends, value, strict=True):
                yield from self._numbers((*path, end), element, names)

    def _ends(self, path: Path, array: Any, names: Sequence[str]) -> Sequence[str]:
        """Return the names of an array's elements, or their numbers."""
        ends = element_names(array, names)
        if ends is not None:
            return ends
        if len(array) and not isinstance(array[0], str):
            low, high = self.counts.get(path, (len(array), len(array)))
            self.counts[path] = (min(low, len(array)), max(high, len(array)))
            if names and isinstance(array[0], _NUMBER):
                self.misfits.setdefault(path, (len(names), len(array)))
        return [str(i) for i in range(len(array))]


def element_names(array: Any, names: Sequence[str]) -> list[str] | None:
    """Return the different names of an array's elements; None without names.

    Args:
        array: a list or an array of shape (n,).
        names: names that the message lists for the elements of its arrays.
    """
    nodes = [] if isinstance(array, np.ndarray) else [_node(element) for element in array]
    if not nodes or nodes[0] is None:
        return list(names) if len(names) == len(array) else None
    of_message = len(names) == len(array) and all(
        node is not None and (_labels(node) or not _has_arrays(node)) for node in nodes
    )
    if of_message:
        return list(names)
    found: dict[str, None] = {}
    for node in nodes:
        identity = () if node is None else _identity(node, numbered=True)
        if not identity:
            return None
        base = label = "_".join(identity)
        again = 1
        while label in found:
            label, again = f"{base}_{again}", again + 1
        found[label] = None
    return list(found)


def _node(value: Any) -> Node | None:
    """Return the fields of a message; None if the value is none."""
    if isinstance(value, dict):
        return {str(key): one for key, one in value.items()}
    if is_dataclass(value):
        return {name: getattr(value, name) for name in _field_names(cast(Hashable, type(value)))}
    return None


@cache
def _field_names(kind: Hashable) -> tuple[str, ...]:
    return tuple(part.name for part in fields(cast(Any, kind)) if part.name != "__msgtype__")


def _labels(node: Node) -> list[str]:
    """Return the names of the elements of a message's arrays; empty if two of them are equal."""
    for name, found in node.items():
        if name in LABELS or name.endswith("_names"):
            kind: type[Any] = str
        elif name in NUMBERS:
            kind = int
        else:
            continue
        labels = found.tolist() if isinstance(found, np.ndarray) else found
        if not isinstance(labels, list) or not all(isinstance(one, kind) for one in labels):
            continue
        if labels and len(set(labels)) == len(labels):
            return [str(one) for one in labels]
    return []


def _identity(node: Node, numbered: bool) -> Path:
    """Return what a message is about; empty if it does not say so.

    Args:
        node: the message.
        numbered: whether it is one of several, so that its number says which one.
    """
    header = node.get("header")
    inner = _node(header) if _is_header("header", header) else None
    frame = "" if inner is None else inner.get("frame_id")
    found = [frame] if isinstance(frame, str) and frame else []
    for name in IDENTITIES:
        value: Any = node.get(name)
        if isinstance(value, str) and value:
            found.append(value)
        elif numbered and name.endswith("id") and _is_number(value):
            found.append("_".join(map(str, np.atleast_1d(value))))
    if numbered and len(found) == 1 and found[0] == frame:
        return ()  # the frame alone names no element: all have the same
    return tuple(found)


def _is_number(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return bool(np.issubdtype(value.dtype, np.integer) and 0 < value.size <= 8)
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def _has_arrays(node: Node) -> bool:
    return any(isinstance(value, list | np.ndarray) for value in node.values())


def _is_header(name: str, value: Any) -> bool:
    if getattr(value, "__msgtype__", "") == HEADER:
        return True
    return name == "header" and isinstance(value, dict) and _time(value.get("stamp")) is not None


def _stamp(node: Node) -> int | None:
    """Return the time stamp of a message [ns]; None if there is none or it is 0."""
    header = node.get("header")
    if _is_header("header", header):
        inner = _node(header)
        return _time(None if inner is None else inner.get("stamp")) or None
    return _time(node.get("timestamp")) or None


def _stamps_of_elements(top: Node) -> dict[Path, int]:
    """Return the time stamps of the elements of a message's arrays, by path."""
    found: dict[Path, int] = {}
    names = _labels(top)
    for name, value in top.items():
        if not isinstance(value, list) or len(value) > MAX_ELEMENTS:
            continue
        nodes = [_node(element) for element in value]
        stamps = [None if node is None else _stamp(node) for node in nodes]
        if nodes and all(stamps):
            ends = element_names(value, names) or [str(i) for i in range(len(value))]
            found |= {(name, end): s for end, s in zip(ends, stamps, strict=True) if s}
    return found


def _time(value: Any) -> int | None:
    """Return a time [ns]; None if the value is none."""
    if getattr(value, "__msgtype__", "") in TIMES:
        return int(value.sec) * 10**9 + int(value.nanosec)
    if isinstance(value, dict):
        for seconds, rest in _TIME_FIELDS:
            if value.keys() == {seconds, rest} and all(_is_number(v) for v in value.values()):
                return int(value[seconds]) * 10**9 + int(value[rest])
    return None


def _float(value: Any) -> float:
    try:
        return float(value)
    except OverflowError:
        return float("nan")
