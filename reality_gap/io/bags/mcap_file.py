"""MCAP files, read from start to end, without their index, even if they are cut off or damaged.

Format: https://mcap.dev/spec
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import BinaryIO

from reality_gap.io.bags.binary import CutOffError, Fields
from reality_gap.io.bags.compression import CompressionError, expand
from reality_gap.io.bags.contents import Channel, Contents, Definition, Message

MAGIC = b"\x89MCAP0\r\n"
"""First and last bytes of an MCAP file."""
LARGEST_CHUNK = 1 << 30
"""Largest size of a decompressed chunk [bytes]; usual are a few MiB."""
ADVICE = "`mcap recover` may recover more"
STATISTICS = "the summary of the file"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _STATISTICS, _DATA_END = 2, 3, 4, 5, 6, 11, 15


class McapFile:
    """Reader of an MCAP file.

    Args:
        path: the file.
        contents: filled with what is found out about the file.
    """

    def __init__(self, path: Path, contents: Contents) -> None:
        self._path, self._contents = path, contents
        self._schemas: dict[int, tuple[str, Definition]] = {}
        self._channels: dict[int, Channel] = {}
        self._unreadable = 0

    def messages(self) -> Iterator[Message]:
        """Yield all messages that can be read."""
        size = self._path.stat().st_size
        with self._path.open("rb") as file:
            file.seek(len(MAGIC))
            ended = yield from self._records(file, size)
        if not ended:
            self._contents.faults.append(f"{self._path.name} is cut off; {ADVICE}")
        if self._unreadable:
            self._contents.faults.append(
                f"{self._unreadable} chunks or records of {self._path.name} are damaged and were "
                f"left out; {ADVICE}"
            )

    def _records(self, file: BinaryIO, size: int) -> Generator[Message, None, bool]:
        """Yield the messages of all records; return whether the file ends as it should."""
        end = len(MAGIC)
        while len(start := file.read(9)) == 9:
            opcode, length = start[0], int.from_bytes(start[1:], "little")
            if opcode == _FOOTER:
                return True
            if opcode == 0 or (opcode > _DATA_END and opcode < 0x80):
                self._unreadable += 1
                return False
            begin, end = end + 9, end + 9 + length
            whole = end <= size
            if opcode in (_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _STATISTICS):
                data = file.read(length if whole else size - begin)
                yield from self._chunk(data, whole) if opcode == _CHUNK else self._one(opcode, data)
            elif whole:
                file.seek(length, 1)
            if not whole:
                return False
            self._contents.share = end / size
        return False

    def _chunk(self, data: bytes, whole: bool) -> Iterator[Message]:
        """Yield the messages of a chunk, of one that is cut off as many as it holds."""
        fields = Fields(data)
        try:
            fields.take(16)
            size, checksum, kind = fields.number(8), fields.number(4), fields.text()
            fields.number(8)
            records = fields.rest()
            complete = len(records) == size
            if kind:
                records, _ = expand(kind, records, min(size, LARGEST_CHUNK))
                complete = len(records) == size
        except CutOffError:
            return
        except CompressionError as error:
            self._contents.faults.append(f"a chunk of {self._path.name} was left out: {error}")
            return
        if complete and checksum and zlib.crc32(records) != checksum:
            self._unreadable += 1
            return
        self._unreadable += whole and not complete
        yield from self._within(Fields(records))

    def _within(self, fields: Fields) -> Iterator[Message]:
        while fields.left >= 9:
            opcode, length = fields.number(1), fields.number(8)
            if length > fields.left:
                return
            yield from self._one(opcode, fields.take(length))

    def _one(self, opcode: int, data: bytes) -> Iterator[Message]:
        """Take in a record that is no chunk; yield it if it is a message."""
        fields = Fields(data)
        try:
            if opcode == _MESSAGE:
                channel = self._channels.get(fields.number(2))
                fields.number(4)
                time, _, message = fields.number(8), fields.number(8), fields.rest()
                if channel is None:
                    self._unreadable += 1
                else:
                    yield Message(channel, time, message)
            elif opcode == _SCHEMA:
                number, name, encoding = fields.number(2), fields.text(), fields.text()
                self._schemas[number] = (name, (encoding, fields.take(fields.number(4))))
            elif opcode == _CHANNEL:
                number, schema = fields.number(2), fields.number(2)
                topic, encoding = fields.text(), fields.text()
                name, definition = self._schemas.get(schema, ("", ("", b"")))
                self._channels[number] = Channel(topic, name, encoding, definition)
                self._contents.topics.add(topic)
            elif opcode == _STATISTICS:
                self._count(fields)
        except CutOffError:
            self._unreadable += 1

    def _count(self, fields: Fields) -> None:
        """Take in how many messages the file holds of each channel."""
        fields.take(42)
        pairs = Fields(fields.take(fields.number(4)))
        counts = self._contents.counted.setdefault(STATISTICS, Counter())
        while pairs.left:
            number, count = pairs.number(2), pairs.number(8)
            if number in self._channels:
                counts[self._channels[number].topic] += count
