"""Files and folders of bags: recognizes the format by the first bytes, not by the suffix."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from reality_gap.errors import StudyError
from reality_gap.io.bags import mcap_file, ros1_file, sqlite_file
from reality_gap.io.bags.compression import CompressionError, expand, expand_file
from reality_gap.io.bags.contents import Contents, Message

METADATA = "metadata.yaml"
"""File of a ROS 2 bag's folder that lists its files and topics."""
SUFFIXES = (".bag", ".active", ".mcap", ".db3", ".zstd")
"""Suffixes of files in the folder of a bag, in lower case."""
LARGEST_MESSAGE = 1 << 28
"""Largest size of a decompressed message [bytes]."""
UNFOLDED = 100
"""Largest ratio of the size of a decompressed file to that of the file."""
PAUSE, OVERLAP = 60 * 10**9, 10**9
"""Longest pause between two files, and longest overlap of them, in one recording [ns]."""

_READERS: dict[bytes, Any] = {
    mcap_file.MAGIC: mcap_file.McapFile,
    ros1_file.MAGIC: ros1_file.Ros1File,
    sqlite_file.MAGIC: sqlite_file.SqliteFile,
}
_ZSTD = b"\x28\xb5\x2f\xfd"
_OTHERS = {
    b"version https://git-lfs": "is a Git LFS pointer, not the file; run `git lfs pull`",
    ros1_file.ANY_VERSION: "is of an old version of ROS 1; convert it with `rosbag fix`",
    b"PAR1": "is a Parquet file, which needs no unpacking; give it to `init`",
    b"ULog": "is a log of PX4; convert it to CSV with `ulog2csv`",
    b"PK\x03\x04": "is a ZIP archive; extract it first",
    b"\x1f\x8b": "is a gzip archive; extract it first",
}
"""Files that are mistaken for bags, by their first bytes, with advice."""


def messages(bag: Path, contents: Contents) -> Iterator[Message]:
    """Yield all messages of a bag that can be read.

    Args:
        bag: a file, or the folder of a ROS 2 bag.
        contents: filled with what is found out about the bag.

    Raises:
        StudyError: it is no bag, or nothing in it can be read.
    """
    found = _folder(bag, contents) if bag.is_dir() else _file(bag, contents)
    for message in found:
        contents.read[message.channel.topic] += 1
        yield message


def _file(path: Path, contents: Contents) -> Iterator[Message]:
    with path.open("rb") as file:
        start = file.read(64)
    if start.startswith(_ZSTD):
        yield from _compressed(path, contents)
        return
    for magic, reader in _READERS.items():
        if start.startswith(magic):
            yield from reader(path, contents).messages()
            return
    for other, what in _OTHERS.items():
        if start.startswith(other):
            raise StudyError(f"{path.name} {what}")
    what = "it is empty" if not start else "it begins like none of these formats"
    raise StudyError(
        f"{path.name} cannot be read as a bag: {what}; valid are ROS 1 bags (.bag), MCAP files, "
        "SQLite files of ROS 2 bags (.db3), and folders of them"
    )


def _compressed(path: Path, contents: Contents) -> Iterator[Message]:
    """Yield the messages of a file that is compressed as a whole."""
    with tempfile.TemporaryDirectory(prefix="bag-") as folder:
        whole = Path(folder) / path.stem
        with path.open("rb") as source, whole.open("wb") as target:
            limit = UNFOLDED * path.stat().st_size + (1 << 20)
            if not expand_file("zstd", source, target, limit):
                contents.faults.append(f"{path.name} is cut off or damaged")
        with whole.open("rb") as file:
            again = file.read(4) == _ZSTD
        if again:
            raise StudyError(f"{path.name} is compressed twice; decompress it with `zstd -d`")
        yield from _file(whole, contents)


def _folder(folder: Path, contents: Contents) -> Iterator[Message]:
    """Yield the messages of all files of a folder."""
    metadata = _metadata(folder, contents)
    contents.distribution = str(metadata.get("ros_distro") or "")
    files = _files(folder, metadata, contents)
    kind = str(metadata.get("compression_format", ""))
    by_message = str(metadata.get("compression_mode", "")).lower() == "message"
    spans: dict[str, tuple[int, int]] = {}
    for i, path in enumerate(files):
        own = Contents(contents.topics, contents.counted, contents.read, contents.faults)
        found = _file(path, own)
        try:
            for message in _decompressed(found, path, kind, contents) if by_message else found:
                contents.share = (i + own.share) / len(files)
                begin, end = spans.get(path.name, (message.time, message.time))
                spans[path.name] = (min(begin, message.time), max(end, message.time))
                yield message
        except StudyError as error:
            if len(files) == 1:
                raise
            contents.faults.append(str(error))
    if not metadata.get("relative_file_paths"):
        contents.faults += _unrelated(spans, folder.name)


def _unrelated(spans: dict[str, tuple[int, int]], folder: str) -> list[str]:
    """Return a sentence if files do not follow one another in time, as parts of a recording do.

    Args:
        spans: times of the first and of the last message [ns], by the name of the file.
        folder: name of the folder.
    """
    ordered = sorted(spans.items(), key=lambda item: item[1])
    for (first, (_, end)), (second, (begin, _)) in pairwise(ordered):
        if -OVERLAP <= begin - end <= PAUSE:
            continue
        distance = f"{1e-9 * abs(begin - end):.6g} s {'after' if begin > end else 'before'}"
        return [
            f"{second} begins {distance} {first} ends, but the files of {folder} are read as one "
            "recording; if they are several, unpack each file separately"
        ]
    return []


def _decompressed(
    found: Iterator[Message], path: Path, kind: str, contents: Contents
) -> Iterator[Message]:
    """Yield messages, each of which is compressed separately."""
    lost = 0
    for message in found:
        try:
            data, whole = expand(kind, message.data, LARGEST_MESSAGE)
        except CompressionError as error:
            raise StudyError(f"{path.name} cannot be read as a bag: {error}") from error
        lost += not whole
        if whole:
            yield message._replace(data=data)
    if lost:
        contents.faults.append(
            f"{lost} messages of {path.name} cannot be decompressed and are left out"
        )


def _metadata(folder: Path, contents: Contents) -> dict[str, Any]:
    """Return what metadata.yaml says; an empty dict, and a line, if it cannot be read."""
    path = folder / METADATA
    try:
        text = path.read_text("utf-8") if path.is_file() else ""
        found = (yaml.safe_load(text) or {}).get("rosbag2_bagfile_information") if text else None
        if not isinstance(found, dict):
            raise ValueError
        counts: Counter[str] = Counter()
        for topic in found.get("topics_with_message_count") or ():
            name = str(topic["topic_metadata"]["name"])
            counts[name] += int(topic["message_count"])
    except (yaml.YAMLError, UnicodeDecodeError, AttributeError, KeyError, TypeError, ValueError):
        if all(p.suffix.lower() in (".bag", ".active") for p in _present(folder)):
            return {}  # of ROS 1, which has no such file
        what = "cannot be read" if path.is_file() else "is missing"
        contents.faults.append(
            f"{METADATA} {what}, so that all files of {folder.name} are read in the order of their "
            "names; `ros2 bag reindex` writes it anew"
        )
        return {}
    contents.topics |= set(counts)
    contents.counted[METADATA] = counts
    return {key: value for key, value in found.items() if value is not None}


def _files(folder: Path, metadata: dict[str, Any], contents: Contents) -> list[Path]:
    """Return the files of a folder in the order of recording."""
    present = _present(folder)
    listed = [Path(str(p)).name for p in metadata.get("relative_file_paths") or ()]
    if not listed:
        if not present:
            raise StudyError(
                f"{folder.name} cannot be read as a bag: the folder holds no .mcap, .db3 or .bag "
                "file"
            )
        return present
    names = {p.name: p for p in present} | {p.stem: p for p in present if p.suffix == ".zstd"}
    missing = [name for name in listed if name not in names]
    contents.faults += [
        f"{METADATA} lists {name}, but {folder.name} does not hold it" for name in missing
    ]
    if len(missing) == len(listed):
        if present:
            return present
        raise StudyError(f"{folder.name} cannot be read as a bag: the file {missing[0]} is missing")
    files = [names[name] for name in listed if name in names]
    contents.faults += [
        f"{METADATA} does not list {path.name}, which is left out"
        for path in present
        if path not in files and path.name not in listed
    ]
    return files


def _present(folder: Path) -> list[Path]:
    """Return the files of a folder that may be of a bag, in the order of their names."""
    return sorted(p for p in folder.iterdir() if p.is_file() and p.suffix.lower() in SUFFIXES)
