"""Messages between a robot and its driver, and their bounds.

A message is the length of its head (4 bytes, big endian), the head (a JSON object), and as many
bytes of a frame as the head's entry ``bytes`` says. JSON has no NaN: a number that is not finite is
null.
"""

from __future__ import annotations

import json
from typing import Any, NamedTuple

import numpy as np

from jmm_agent.types import Floats
from kengoro.errors import UsageError

MAX_HEAD = 64 << 10
"""Largest head [bytes]: numbers of some thousand muscles."""
MAX_FRAME = 64 << 20
"""Largest frame [bytes]: 22 megapixels."""


class MessageError(UsageError):
    """A message that is not valid: what was wrong, and what would be valid."""


class Message(NamedTuple):
    """A head, and the bytes of a frame.

    Attributes:
        head: the JSON object.
        body: of the frame; empty without one.
    """

    head: dict[str, Any]
    body: bytes = b""

    @property
    def kind(self) -> str:
        """What the message is, its entry ``kind``; empty without one."""
        kind = self.head.get("kind")
        return kind if isinstance(kind, str) else ""

    def encoded(self) -> bytes:
        """The bytes of the message."""
        text = json.dumps(self.head | {"bytes": len(self.body)}, allow_nan=False).encode()
        return len(text).to_bytes(4, "big") + text + self.body

    def text(self, name: str) -> str:
        """An entry that is a text of at most 1000 characters."""
        value = self.head.get(name)
        if not isinstance(value, str) or len(value) > 1000:
            raise self.wrong(name, "a short text")
        return value

    def integer(self, name: str) -> int:
        """An entry that is an integer from 0 on."""
        value = self.head.get(name)
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**53:
            raise self.wrong(name, "an integer from 0 on")
        return value

    def number(self, name: str) -> float | None:
        """An entry that is a finite number; None if it is null."""
        value = self.head.get(name)
        return None if value is None else float(self._numbers(name, [value])[0])

    def numbers(self, name: str, count: int | None, gaps: bool = False) -> Floats:
        """An entry that is a list of numbers.

        Args:
            name: of the entry.
            count: length of the list; None for any.
            gaps: whether some may be null, which is returned as NaN.
        """
        value = self.head.get(name)
        if not isinstance(value, list) or (count is not None and len(value) != count):
            raise self.wrong(
                name, "a list of numbers" if count is None else f"a list of {count} numbers"
            )
        if gaps:
            value = [np.nan if entry is None else entry for entry in value]
        return self._numbers(name, value, gaps)

    def frame(self) -> np.ndarray | None:
        """The frame (H, W, 3) uint8; None if there is none."""
        shape = self.head.get("frame")
        if shape is None:
            return None
        valid = isinstance(shape, list) and len(shape) == 3 and shape[2] == 3
        if not valid or not all(type(side) is int and 0 < side < 2**16 for side in shape):
            raise self.wrong("frame", "the shape [height, width, 3]")
        if shape[0] * shape[1] * 3 != len(self.body):
            raise MessageError(
                f"Message {self.kind!r}: a frame of shape {shape} has not {len(self.body)} bytes."
            )
        return np.frombuffer(self.body, np.uint8).reshape(shape)

    def _numbers(self, name: str, values: list[Any], gaps: bool = False) -> Floats:
        if any(isinstance(value, bool) or not isinstance(value, int | float) for value in values):
            raise self.wrong(name, "numbers")
        try:
            array = np.array([float(value) for value in values])
        except OverflowError as error:
            raise self.wrong(name, "finite numbers") from error
        if np.isinf(array).any() or (not gaps and np.isnan(array).any()):
            raise self.wrong(name, "finite numbers")
        return array

    def wrong(self, name: str, valid: str) -> MessageError:
        """An error that says what an entry must be."""
        return MessageError(f"Message {self.kind!r}: its entry {name!r} must be {valid}.")


def encodable(numbers: Floats) -> list[float | None]:
    """Numbers as JSON holds them: null for one that is not finite."""
    return [float(x) if np.isfinite(x) else None for x in np.asarray(numbers, dtype=float).ravel()]


class MessageReader:
    """Assembles the messages of a stream of bytes, within bounds.

    Args:
        max_body: largest body [bytes]; 0 where no frames are expected.
    """

    def __init__(self, max_body: int = 0) -> None:
        self._max_body, self._buffer = max_body, bytearray()
        self._head: dict[str, Any] | None = None

    def feed(self, data: bytes) -> list[Message]:
        """Messages that are complete with these bytes.

        Args:
            data: that arrived.

        Raises:
            MessageError: a message is larger than the bounds, or its head is not a JSON object.
        """
        self._buffer += data
        found: list[Message] = []
        while True:
            if self._head is None:
                if len(self._buffer) < 4:
                    return found
                size = int.from_bytes(self._buffer[:4], "big")
                if not 0 < size <= MAX_HEAD:
                    raise MessageError(
                        f"A message begins with a head of {size} bytes; it must have 1 to "
                        f"{MAX_HEAD}."
                    )
                if len(self._buffer) < 4 + size:
                    return found
                self._head = self._parsed(bytes(self._buffer[4 : 4 + size]))
                del self._buffer[: 4 + size]
            body = Message(self._head).integer("bytes")
            if body > self._max_body:
                raise MessageError(
                    f"A message has a frame of {body} bytes; at most {self._max_body} are allowed."
                )
            if len(self._buffer) < body:
                return found
            found.append(Message(self._head, bytes(self._buffer[:body])))
            del self._buffer[:body]
            self._head = None

    def _parsed(self, text: bytes) -> dict[str, Any]:
        try:
            head = json.loads(text.decode())
        except (ValueError, RecursionError) as error:
            raise MessageError("A message has a head that is not JSON in UTF-8.") from error
        if not isinstance(head, dict):
            raise MessageError("A message has a head that is not a JSON object.")
        return head
