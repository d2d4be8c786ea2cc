"""SQLite files of ROS 2 bags, in the order of recording, up to the first damaged page.

Format: https://github.com/ros2/rosbag2, rosbag2_storage_sqlite3
"""

from __future__ import annotations

import os
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from urllib.parse import quote

from reality_gap.errors import StudyError
from reality_gap.io.bags.contents import Channel, Contents, Definition, Message

MAGIC = b"SQLite format 3\0"
"""First bytes of an SQLite file."""
DAMAGED = (sqlite3.Error, UnicodeDecodeError, OverflowError)
"""Errors that sqlite3 raises for damaged files; its messages may quote bytes that are no text."""
ADVICE = "`sqlite3 FILE .recover`, then `ros2 bag reindex`, may recover more"


class SqliteFile:
    """Reader of an SQLite file of a ROS 2 bag.

    Args:
        path: the file.
        contents: filled with what is found out about the file.
    """

    def __init__(self, path: Path, contents: Contents) -> None:
        self._path, self._contents = path, contents

    def messages(self) -> Iterator[Message]:
        """Yield all messages that can be read.

        Raises:
            StudyError: the file has no tables of a bag.
        """
        # The journal holds messages only if recording was interrupted. If not, it is not opened.
        journal = self._path.with_name(f"{self._path.name}-wal")
        unfinished = journal.is_file() and journal.stat().st_size > 0
        options = "mode=ro" if unfinished else "mode=ro&immutable=1"
        with (
            _whole_pages(self._path) as path,
            closing(sqlite3.connect(f"file:{quote(str(path))}?{options}", uri=True)) as database,
        ):
            database.text_factory = lambda text: text.decode("utf-8", "replace")
            try:
                channels = self._channels(database)
            except DAMAGED as error:
                raise StudyError(
                    f"{self._path.name} cannot be read as a bag: its topics cannot be read "
                    f"({error}); {ADVICE}"
                ) from error
            self._contents.topics |= {channel.topic for channel in channels.values()}
            try:
                yield from self._rows(database, channels)
            except DAMAGED as error:
                fault = f"{self._path.name} is cut off or damaged ({error}); {ADVICE}"
                if fault not in self._contents.faults:
                    self._contents.faults.append(fault)

    def _channels(self, database: sqlite3.Connection) -> dict[int, Channel]:
        """Return the channels by the numbers of their topics."""
        try:
            return _channels(database)
        except DAMAGED as error:
            # SQLite refuses a file that is shorter than it says, unless its schema may be mended.
            database.execute("PRAGMA writable_schema = ON")
            channels = _channels(database)
            self._contents.faults.append(
                f"{self._path.name} is cut off or damaged ({error}); {ADVICE}"
            )
            return channels

    def _rows(
        self, database: sqlite3.Connection, channels: dict[int, Channel]
    ) -> Iterator[Message]:
        size, done, lost = max(self._path.stat().st_size, 1), 0, 0
        rows = database.execute("SELECT topic_id, timestamp, data FROM messages NOT INDEXED")
        for number, time, data in rows:
            if number not in channels or not isinstance(time, int) or not isinstance(data, bytes):
                lost += 1
                continue
            done += len(data)
            self._contents.share = min(done / size, 1.0)
            yield Message(channels[number], time, data)
        if lost:
            self._contents.faults.append(
                f"{lost} messages of {self._path.name} have no topic, no time or no data"
            )


@contextmanager
def _whole_pages(path: Path) -> Iterator[Path]:
    """A file without its last page if that is cut off, which SQLite would fill with zeros."""
    with path.open("rb") as file:
        page = int.from_bytes(file.read(18)[16:], "big")
    # One means 65536. A page whose size is no power of two is left to SQLite, which refuses it.
    page = 1 << 16 if page == 1 else page
    size = path.stat().st_size
    if not page or not size % page:
        yield path.absolute()
        return
    with tempfile.TemporaryDirectory(prefix="bag-") as folder:
        whole = Path(folder) / path.name
        shutil.copyfile(path, whole)
        os.truncate(whole, size - size % page)
        yield whole


def _channels(database: sqlite3.Connection) -> dict[int, Channel]:
    """Return the channels by the numbers of their topics."""
    tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master")}
    definitions: dict[str, Definition] = {}
    if "message_definitions" in tables:
        query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        for kind, encoding, text in database.execute(query):
            definitions[kind] = (str(encoding), str(text).encode())
    return {
        number: Channel(str(topic), str(kind), str(encoding), definitions.get(kind, ("", b"")))
        for number, topic, kind, encoding in database.execute(
            "SELECT id, name, type, serialization_format FROM topics"
        )
    }
