"""Topics: the numbers of a topic's messages as a table, and its file."""

from __future__ import annotations

import re
from array import array
from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv
from numpy.typing import NDArray

from reality_gap.errors import StudyError
from reality_gap.io.bags.values import Entry, Path
from reality_gap.io.tables import MAX_CELLS

MAX_IDENTITIES = 256
"""Largest number of things that one topic may be about, each with columns of its own."""

LATEST = 1 << 62
"""Limit of times, in the year 2116 [ns since 1970]."""

Nanoseconds = NDArray[np.int64]
"""Times [ns]."""


class Order(NamedTuple):
    """Order of the times of a topic, by the column that it concerns most.

    Attributes:
        overwritten: number of values that a later one of the same time replaces.
        steps_back: how often the time goes back from one message to the next.
        longest: longest of these steps [ns].
    """

    overwritten: int
    steps_back: int
    longest: int


class Topic:
    """The numbers in the messages of a topic.

    Args:
        name: name of the topic.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._arrival, self._stamp = array("q"), array("q")
        self._columns: dict[tuple[Path, Path], tuple[array[int], array[float]]] = {}
        self._unstamped = 0

    @property
    def stem(self) -> str:
        """The name as one word, with which file name and column names begin."""
        return "_".join(filter(None, map(word, self.name.split("/")))) or "topic"

    @property
    def empty(self) -> bool:
        """Whether no message holds a number."""
        return not self._columns

    @property
    def rows(self) -> int:
        """Number of entries."""
        return len(self._arrival)

    @property
    def unstamped(self) -> int:
        """Number of entries without a time stamp."""
        return self._unstamped

    @property
    def identities(self) -> int:
        """How many things the topic is about."""
        return len({identity for identity, _ in self._columns})

    def add(self, arrival: int, entry: Entry) -> None:
        """Take in numbers that were recorded at a time [ns].

        Raises:
            ValueError: a time is out of range.
        """
        if not all(abs(time) < LATEST for time in (arrival, entry.stamp or 0)):
            raise ValueError("a time is out of range")
        row = len(self._arrival)
        self._arrival.append(arrival)
        self._stamp.append(0 if entry.stamp is None else entry.stamp)
        self._unstamped += entry.stamp is None
        for path, number in entry.cells.items():
            key = (entry.identity, path)
            column = self._columns.get(key)
            if column is None:
                column = self._columns[key] = (array("q"), array("d"))
            column[0].append(row)
            column[1].append(number)

    def time(self, by_arrival: bool) -> Nanoseconds:
        """Return the time of each entry, shape (n,) [ns].

        It is the sender's time stamp, or the time of arrival if a stamp is missing or
        ``by_arrival`` is true.
        """
        by_arrival = by_arrival or self._unstamped > 0
        return np.array(self._arrival if by_arrival else self._stamp, dtype=np.int64)

    def order(self, by_arrival: bool) -> Order:
        """Return how many values share a time, and how often times go back, see `Order`."""
        time = self.time(by_arrival)
        overwritten = steps = longest = 0
        for rows in {rows.tobytes() for rows, _ in self._columns.values()}:  # many are equal
            own = time[np.frombuffer(rows, dtype=np.int64)]
            change = np.diff(own)
            overwritten = max(overwritten, int(np.count_nonzero(np.diff(np.sort(own)) == 0)))
            steps = max(steps, int(np.count_nonzero(change < 0)))
            longest = max(longest, -int(change.min(initial=0)))
        return Order(overwritten, steps, longest)

    def not_finite(self) -> tuple[int, list[str]]:
        """Return how many numbers are NaN or infinite, and the names of columns of only those."""
        labels, _ = self.labels()
        count, empty = 0, []
        for key, (_, numbers) in self._columns.items():
            finite = int(np.count_nonzero(np.isfinite(numbers)))
            count += len(numbers) - finite
            if not finite:
                empty.append(labels[key])
        return count, empty

    def labels(self) -> tuple[dict[tuple[Path, Path], str], list[str]]:
        """Return the names of the columns, and the names that stand for more than one."""
        identities = list(dict.fromkeys(identity for identity, _ in self._columns))
        several = 1 < len(identities) <= MAX_IDENTITIES
        shown = dict(zip(identities, _differences(identities), strict=True)) if several else {}
        found: dict[str, tuple[Path, Path]] = {}
        same = []
        for key in self._columns:
            identity, path = key
            base = label = "_".join((self.stem, *map(word, (*shown.get(identity, ()), *path))))
            again = 2
            while label in found:
                label, again = f"{base}_{again}", again + 1
            if label != base:
                same.append(base)
            found[label] = key
        return {key: label for label, key in found.items()}, same

    def write(self, path: FilePath, start: int, by_arrival: bool) -> None:
        """Write a table ordered by time; of several numbers of the same time the last stays.

        Args:
            path: the file.
            start: time at which the column ``time`` is 0 [ns].
            by_arrival: use the time at which messages were recorded.

        Raises:
            StudyError: the table has too many cells.
        """
        times, row_of = np.unique(self.time(by_arrival), return_inverse=True)
        labels, _ = self.labels()
        cells = len(labels) * len(times)
        if cells > MAX_CELLS:
            raise StudyError(
                f"{self.name} has {cells} cells, more than {MAX_CELLS}; choose other topics"
            )
        columns = {"time": pa.array((times - start) * 1e-9)}
        for key, label in labels.items():
            rows, numbers = (np.array(part) for part in self._columns[key])
            known = np.isfinite(numbers)
            values = np.full(len(times), np.nan)
            values[row_of[rows[known]]] = numbers[known]
            columns[label] = pa.array(values, mask=np.isnan(values))
        style = pyarrow.csv.WriteOptions(quoting_style="needed")
        pyarrow.csv.write_csv(pa.table(columns), path, style)


def word(text: str) -> str:
    """Return a name without what has a meaning in a file name or a line of column names."""
    return re.sub(r"[^\w.:+-]+", "_", text).strip("_")


def _differences(identities: list[Path]) -> list[Path]:
    """Return the parts of identities in which they differ."""
    if len({len(identity) for identity in identities}) > 1:
        return identities
    varied = [i for i in range(len(identities[0])) if len({one[i] for one in identities}) > 1]
    return [tuple(one[i] for i in varied) for one in identities]
