"""Bags: converts ROS 1 and ROS 2 bags and MCAP files to CSV files that a study can use.

Each topic becomes a file, because each topic has its own times. Text, images and point clouds are
left out. Needs the package rosbags: ``pip install 'kengoro[ros]'``.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv

from reality_gap.errors import StudyError, UnknownNameError
from reality_gap.io.tables import MAX_CELLS
from reality_gap.types import Floats

MAX_ELEMENTS = 256
"""Largest number of elements of an array; longer ones are images, point clouds or maps."""
LABELS = ("name", "names", "joint_names")
"""Fields of a message that name the elements of its arrays."""
HEADER = "std_msgs/msg/Header"
TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")


@dataclass
class Topic:
    """The numbers in the messages of a topic.

    Attributes:
        name: as in the bag.
        arrival: when each message was recorded [s].
        stamp: time stamp by the sender of each message [s]; NaN without one.
        cells: numbers of each message by column name.
    """

    name: str
    arrival: list[float] = field(default_factory=list)
    stamp: list[float] = field(default_factory=list)
    cells: list[dict[str, float]] = field(default_factory=list)

    @property
    def stem(self) -> str:
        """The name as one word, with which file name and column names begin."""
        return "_".join(part for part in self.name.split("/") if part)

    def time(self, by_arrival: bool) -> Floats:
        """Return the time of each message, shape (n,) [s].

        It is the sender's time stamp, or the time of arrival if a stamp is missing or
        ``by_arrival`` is true.
        """
        stamps = np.array(self.stamp)
        return np.array(self.arrival) if by_arrival or np.isnan(stamps).any() else stamps


def unpack(
    bag: Path,
    out: Path,
    topics: Sequence[str] = (),
    by_arrival: bool = False,
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[Path, ...]:
    """Write a bag's topics as CSV files into a new folder, all of them or none.

    Each file has a column ``time`` [s], which is 0 at the earliest message of all files. The
    other columns are named after topic and field, and after the joint if the message names
    joints, as in ``joint_states_position_elbow``. Units are those of the bag (SI in ROS).

    Args:
        bag: a .bag file, the folder of a ROS 2 bag, or an .mcap file.
        out: folder to create.
        topics: topics to write; by default all that hold numbers.
        by_arrival: use the time at which messages were recorded instead of their time stamps.
        progress: called with the fraction of the bag that has been read, 0 to 1.

    Returns:
        The files, in the order of the topics' names.

    Raises:
        StudyError: the bag cannot be read, holds no numbers, or ``out`` exists.
        UnknownNameError: the bag has no such topic.
    """
    check_new(out)
    found = [topic for topic in read_bag(bag, topics, progress) if any(topic.cells)]
    if not found:
        raise StudyError(f"{bag.name} has no message that contains a number")
    stems = [topic.stem for topic in found]
    if len(set(stems)) < len(stems):
        twice = next(stem for stem in stems if stems.count(stem) > 1)
        raise StudyError(f"two topics of {bag.name} would both be {twice}.csv; choose one of them")
    times = [topic.time(by_arrival) for topic in found]
    start = min(float(time.min()) for time in times)
    out = out.resolve()
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{out.name}-", dir=out.parent) as temporary:
        new = Path(temporary) / "new"
        new.mkdir()
        for topic, time in zip(found, times, strict=True):
            _write(new / f"{topic.stem}.csv", topic, time - start)
        new.rename(out)
    return tuple(out / f"{stem}.csv" for stem in stems)


def check_new(out: Path) -> None:
    """Raise `StudyError` if ``out`` exists."""
    if out.exists():
        raise StudyError(f"{out} exists and is not overwritten; give a new folder")


def read_bag(
    bag: Path, topics: Sequence[str] = (), progress: Callable[[float], None] = lambda share: None
) -> list[Topic]:
    """Read all numbers in the messages of a bag.

    Args and errors are those of `unpack`.

    Returns:
        The topics in the order of their names.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise StudyError(
            "reading bags needs the package rosbags: pip install 'kengoro[ros]'"
        ) from error
    if not bag.exists():
        raise StudyError(f"there is no bag {bag}")
    found: dict[str, Topic] = {}
    try:
        # ROS 2 bags from before 2023 do not contain the definitions of their messages.
        types = get_typestore(Stores.LATEST)
        with AnyReader([bag], default_typestore=types) as reader:
            for name in topics:
                if name not in reader.topics:
                    raise UnknownNameError("topic", name, sorted(reader.topics))
            chosen = [c for c in reader.connections if not topics or c.topic in topics]
            if not chosen:
                return []
            for i, (connection, when, raw) in enumerate(reader.messages(chosen)):
                topic = found.setdefault(connection.topic, Topic(connection.topic))
                message = reader.deserialize(raw, connection.msgtype)
                topic.arrival.append(1e-9 * when)
                topic.stamp.append(_stamp(message))
                topic.cells.append(dict(_numbers(topic.stem, message, ())))
                if i % 100 == 0:
                    progress(i / reader.message_count)
    except StudyError:
        raise
    except Exception as error:  # on damaged files the reader raises errors of any type
        what = " ".join(str(error).split()) or type(error).__name__
        raise StudyError(f"{bag.name} cannot be read as a bag: {what}") from error
    return [found[name] for name in sorted(found)]


def _stamp(message: Any) -> float:
    """Return the time stamp in a message's header [s]; NaN if there is none or it is 0."""
    header: Any = getattr(message, "header", None)
    if getattr(header, "__msgtype__", "") != HEADER:
        return float("nan")
    return _seconds(header.stamp) or float("nan")


def _seconds(time: Any) -> float:
    return float(time.sec + 1e-9 * time.nanosec)


def _numbers(label: str, value: Any, names: Sequence[str]) -> Iterator[tuple[str, float]]:
    """Yield column name and number of all numbers in a value."""
    if isinstance(value, int | float | np.number | np.bool_):
        yield label, float(value)
    elif is_dataclass(value):
        kind = getattr(value, "__msgtype__", "")
        if kind in TIMES:
            yield label, _seconds(value)
        elif kind != HEADER:
            own = _labels(value) or names
            for part in fields(value):
                if part.name != "__msgtype__":
                    yield from _numbers(f"{label}_{part.name}", getattr(value, part.name), own)
    elif isinstance(value, list | np.ndarray) and len(value) <= MAX_ELEMENTS:
        ends = names if len(names) == len(value) else [str(i) for i in range(len(value))]
        for end, element in zip(ends, value, strict=True):
            yield from _numbers(f"{label}_{end}", element, names)


def _labels(message: Any) -> list[str]:
    """Return the names of a message's array elements; empty if two of them are equal."""
    for name in LABELS:
        found = getattr(message, name, None)
        if isinstance(found, list) and len(set(map(str, found))) == len(found):
            return [str(one) for one in found]
    return []


def _write(path: Path, topic: Topic, time: Floats) -> None:
    """Write a topic ordered by time; of several messages of the same time only the last."""
    order = np.argsort(time, kind="stable")
    last = np.append(np.diff(time[order]) > 0, True)
    rows = order[last]
    names = list(dict.fromkeys(name for cells in topic.cells for name in cells))
    if len(names) * len(rows) > MAX_CELLS:
        raise StudyError(
            f"{topic.name} has {len(names) * len(rows)} cells, more than {MAX_CELLS}; choose other "
            "topics"
        )
    columns = {"time": pa.array(np.round(time[rows], 9))}
    for name in names:
        values = np.array([topic.cells[row].get(name, np.nan) for row in rows])
        columns[name] = pa.array(values, mask=~np.isfinite(values))
    style = pyarrow.csv.WriteOptions(quoting_style="needed")
    pyarrow.csv.write_csv(pa.table(columns), path, style)
