"""Values of the last seconds, for any control period."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Generic, NamedTuple, TypeVar

T = TypeVar("T")

ROUNDING = 1e-6
"""Difference below which two times are the same [s]; stamps since 1970 are rounded to 0.24 us."""


class Entry(NamedTuple, Generic[T]):
    """A value, and the time for which it stands.

    Attributes:
        begin: [s].
        end: [s].
        value: the value.
    """

    begin: float
    end: float
    value: T


class Recent(Generic[T]):
    """The newest values, as few as cover a duration.

    Args:
        duration: that they cover [s].
    """

    def __init__(self, duration: float) -> None:
        self._duration = duration
        self.clear()

    def clear(self) -> None:
        """Forget all values."""
        self._now = 0.0
        self._entries: deque[Entry[T]] = deque()

    def add(self, dt: float, value: T) -> None:
        """Add a value that stands for the last ``dt`` [s]."""
        begin, self._now = self._now, self._now + dt
        self._entries.append(Entry(begin, self._now, value))
        while len(self._entries) > 1 and self._covers(self._entries[1]):
            self._entries.popleft()

    @property
    def full(self) -> bool:
        """Whether the values cover the duration."""
        return bool(self._entries) and self._covers(self._entries[0])

    @property
    def values(self) -> list[T]:
        """The values, the oldest first."""
        return [entry.value for entry in self._entries]

    @property
    def oldest(self) -> T:
        """The oldest value; there must be one."""
        return self._entries[0].value

    def newer(self, age: float) -> list[T]:
        """Values that stand for nothing older than an age [s]; at least the newest."""
        begin = self._now - age - ROUNDING
        found = [entry.value for entry in self._entries if entry.begin >= begin]
        return found or [self._entries[-1].value]

    def older(self, age: float) -> list[T]:
        """Values that stand for nothing newer than an age [s]."""
        end = self._now - age + ROUNDING
        return [entry.value for entry in self._entries if entry.end <= end]

    def at(self, ages: Sequence[float]) -> list[tuple[int, T]]:
        """The value that stands for each age, and its number from the newest, which is 0.

        Args:
            ages: ascending [s]; older values than there are count as the oldest.
        """
        found, number, last = list[tuple[int, T]](), 0, len(self._entries) - 1
        for age in ages:
            while (
                number < last and self._entries[last - number].begin >= self._now - age - ROUNDING
            ):
                number += 1
            found.append((number, self._entries[last - number].value))
        return found

    def _covers(self, entry: Entry[T]) -> bool:
        return self._now - entry.begin >= self._duration - ROUNDING
