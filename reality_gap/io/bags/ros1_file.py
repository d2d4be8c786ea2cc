"""ROS 1 bags, read from start to end, without their index, even if recording was not finished.

Format: https://wiki.ros.org/Bags/Format/2.0
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import BinaryIO

from reality_gap.io.bags.binary import CutOffError, Fields
from reality_gap.io.bags.compression import CompressionError, expand
from reality_gap.io.bags.contents import Channel, Contents, Message

MAGIC = b"#ROSBAG V2.0\n"
"""First bytes of a ROS 1 bag."""
ANY_VERSION = b"#ROSBAG V"
"""First bytes of a ROS 1 bag of any version."""
LARGEST_CHUNK = 1 << 30
"""Largest size of a decompressed chunk [bytes]; usual are 768 KiB."""
ADVICE = "`rosbag reindex` may recover more"
INDEX = "the index of the file"
_MESSAGE, _BAG, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 3, 5, 6, 7

Header = dict[str, bytes]
"""Fields of a record's header."""


class Ros1File:
    """Reader of a ROS 1 bag.

    Args:
        path: the file.
        contents: filled with what is found out about the file.
    """

    def __init__(self, path: Path, contents: Contents) -> None:
        self._path, self._contents = path, contents
        self._channels: dict[int, Channel] = {}
        self._counts: Counter[int] = Counter()
        self._indexed = False
        self._unreadable = 0

    def messages(self) -> Iterator[Message]:
        """Yield all messages that can be read."""
        faults, name = self._contents.faults, self._path.name
        with self._path.open("rb") as file:
            file.seek(len(MAGIC))
            whole = yield from self._records(file, self._path.stat().st_size)
        self._unreadable -= not whole and self._unreadable > 0  # the one that is cut off
        if not whole:
            faults.append(f"{name} is cut off or damaged; {ADVICE}")
        elif not self._indexed:
            faults.append(f"{name} has no index: its recording was not finished; {ADVICE}")
        if self._unreadable:
            faults.append(
                f"{self._unreadable} chunks or messages of {name} are damaged and were left out; "
                f"{ADVICE}"
            )
        if self._counts:
            counts = self._contents.counted.setdefault(INDEX, Counter())
            for number, count in self._counts.items():
                if number in self._channels:
                    counts[self._channels[number].topic] += count

    def _records(self, file: BinaryIO, size: int) -> Generator[Message, None, bool]:
        """Yield the messages of all records; return whether the last record is whole."""
        end = len(MAGIC)
        while start := file.read(4):
            begin = end + len(start)
            header = file.read(min(int.from_bytes(start, "little"), size - begin))
            count = file.read(4)
            begin += len(header) + len(count)
            end = begin + int.from_bytes(count, "little")
            whole = end <= size
            try:
                data = file.read(min(end, size) - begin)
                yield from self._record(_header(header), data)
            except CutOffError:
                return False
            if not whole:
                return False
            self._contents.share = end / size
        return True

    def _record(self, header: Header, data: bytes) -> Iterator[Message]:
        """Take in a record, and yield its messages."""
        operation = _number(header, "op")
        if operation == _CHUNK:
            yield from self._chunk(header, data)
        elif operation == _MESSAGE:
            channel = self._channels.get(_number(header, "conn"))
            if channel is None:
                self._unreadable += 1
            else:
                time = Fields(_field(header, "time"))
                yield Message(channel, time.number(4) * 10**9 + time.number(4), data)
        elif operation == _CONNECTION:
            self._connect(header, data)
        elif operation == _CHUNK_INFO:
            pairs = Fields(data)
            while pairs.left >= 8:
                self._counts[pairs.number(4)] += pairs.number(4)
        elif operation == _BAG:
            self._indexed = _number(header, "index_pos") > 0
            if "encryptor" in header and header["encryptor"].strip():
                self._contents.faults.append(
                    f"{self._path.name} is encrypted; decrypt it with `rosbag decrypt`"
                )

    def _chunk(self, header: Header, data: bytes) -> Iterator[Message]:
        kind = _field(header, "compression").decode("ascii", "replace")
        if kind != "none":
            size = min(_number(header, "size"), LARGEST_CHUNK)
            try:
                data, whole = expand(kind, data, size)
            except CompressionError as error:
                self._contents.faults.append(f"a chunk of {self._path.name} was left out: {error}")
                return
            self._unreadable += not whole and len(data) < size
        fields = Fields(data)
        while fields.left:
            try:
                record = _header(fields.take(fields.number(4)))
                yield from self._record(record, fields.take(fields.number(4)))
            except CutOffError:
                self._unreadable += 1
                return

    def _connect(self, header: Header, data: bytes) -> None:
        inner = _header(data)
        topic = _field(header, "topic").decode("utf-8", "replace")
        kind = _field(inner, "type").decode("utf-8", "replace")
        text = inner.get("message_definition", b"")
        self._channels[_number(header, "conn")] = Channel(topic, kind, "ros1", ("ros1msg", text))
        self._contents.topics.add(topic)


def _header(data: bytes) -> Header:
    """Return the fields of a header."""
    fields, found = Fields(data), {}
    while fields.left:
        name, _, value = fields.take(fields.number(4)).partition(b"=")
        found[name.decode("ascii", "replace")] = value
    return found


def _field(header: Header, name: str) -> bytes:
    if name not in header:
        raise CutOffError
    return header[name]


def _number(header: Header, name: str) -> int:
    return int.from_bytes(_field(header, name), "little")
