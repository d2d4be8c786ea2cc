"""Fields of binary records, little-endian; an error if a record ends before a field."""

from __future__ import annotations


class CutOffError(ValueError):
    """A record ends before one of its fields."""


class Fields:
    """Reads the fields of a record one after another.

    Args:
        data: the record.
    """

    def __init__(self, data: bytes | memoryview) -> None:
        self._data, self._at = memoryview(data), 0

    @property
    def left(self) -> int:
        """Number of bytes that have not been read."""
        return len(self._data) - self._at

    def number(self, size: int) -> int:
        """Return an unsigned integer of ``size`` bytes: 1, 2, 4 or 8."""
        return int.from_bytes(self.take(size), "little")

    def take(self, size: int) -> bytes:
        """Return the next ``size`` bytes."""
        if size > self.left:
            raise CutOffError
        self._at += size
        return bytes(self._data[self._at - size : self._at])

    def rest(self) -> bytes:
        """Return all bytes that are left."""
        return self.take(self.left)

    def text(self) -> str:
        """Return a string that begins with its length in 4 bytes."""
        return self.take(self.number(4)).decode("utf-8", "replace")
