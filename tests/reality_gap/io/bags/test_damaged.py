"""Damaged bags: what can be read of them is read, and the rest is named with advice."""

from __future__ import annotations

import shutil
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from backports import zstd
from mcap.writer import CompressionType, IndexType
from rosbags.rosbag1 import Writer as Writer1

from reality_gap.errors import StudyError
from reality_gap.io.bags import files
from reality_gap.io.bags.compression import CompressionError, expand
from reality_gap.io.bags.contents import Contents
from reality_gap.io.rosbag import unpack
from tests.reality_gap.io.recordings import (
    ROS1,
    ROS2,
    START,
    Messages,
    columns_of,
    record,
    ros_rows,
    write_mcap,
)

COUNT = 400


def rows(messages: Messages, count: int = COUNT) -> list[Any]:
    random = np.random.default_rng(5)
    return [
        ("/j", 0.01 * i, messages.joints(0.01 * i, ["a", "b"], random.normal(size=2)))
        for i in range(count)
    ]


def cut(path: Path, share: float) -> Path:
    data = path.read_bytes()
    path.write_bytes(data[: round(share * len(data))])
    return path


def salvaged(bag: Path, folder: Path) -> tuple[int, list[str]]:
    """Number of rows that were read, and the notes."""
    notes: list[str] = []
    [log] = unpack(bag, folder / "logs", note=notes.append)
    return len(columns_of(log)["time"]), notes


@pytest.mark.parametrize("kind", list(CompressionType))
@pytest.mark.parametrize("chunk", [1 << 12, 1 << 24])
def test_mcap_that_is_cut_off_is_read_up_to_there(
    tmp_path: Path, kind: CompressionType, chunk: int
) -> None:
    """Also within a chunk, of which the file may have one only."""
    messages, count = Messages(ROS2), COUNT if chunk < 1 << 20 else 6 * COUNT
    path = write_mcap(
        tmp_path / "run.mcap",
        ros_rows(messages, rows(messages, count)),
        compression=kind,
        chunk_size=chunk,
        index_types=IndexType.NONE,
    )
    read, notes = salvaged(cut(path, 0.6), tmp_path)

    assert 0.2 * count < read < 0.75 * count
    assert notes == ["run.mcap is cut off; `mcap recover` may recover more"]


def test_mcap_in_a_folder_reports_how_much_is_missing(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    folder = record(tmp_path / "run", messages, rows(messages), mcap=True)
    [path] = folder.glob("*.mcap")
    read, notes = salvaged(cut(path, 0.6).parent, tmp_path)

    assert notes[1] == (
        f"/j: {read} of the {COUNT} messages that metadata.yaml lists were read; {COUNT - read} "
        "are missing"
    )


def test_a_damaged_chunk_of_mcap_is_left_out(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    path = write_mcap(
        tmp_path / "run.mcap",
        ros_rows(messages, rows(messages)),
        chunk_size=1 << 12,
        index_types=IndexType.NONE,
    )
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    read, notes = salvaged(path, tmp_path)

    assert 0.7 * COUNT < read < COUNT
    assert any("damaged and were left out; `mcap recover` may recover more" in n for n in notes)
    assert any(f"of the {COUNT} messages that the summary of the file lists" in n for n in notes)


@pytest.mark.parametrize("kind", [None, *Writer1.CompressionFormat])
@pytest.mark.parametrize("name", ["run.bag", "run.bag.active", "RUN.BAG"])
def test_ros1_bags_that_are_cut_off_are_read_up_to_there(
    tmp_path: Path, kind: Any, name: str
) -> None:
    messages = Messages(ROS1)
    path = tmp_path / "whole.bag"
    writer = Writer1(path)
    if kind is not None:
        writer.set_compression(kind)
    writer.chunk_threshold = 1 << 12
    with writer:
        store = messages.store
        connection = writer.add_connection("/j", "sensor_msgs/msg/JointState", typestore=store)
        for _, arrival, message in rows(messages):
            data = store.serialize_ros1(message, message.__msgtype__)
            writer.write(connection, START * 10**9 + round(1e9 * arrival), data)
    read, notes = salvaged(cut(path, 0.5).rename(tmp_path / name), tmp_path)

    assert 0.3 * COUNT < read < 0.7 * COUNT
    assert notes == [f"{name} is cut off or damaged; `rosbag reindex` may recover more"]


def test_a_ros1_bag_without_index_is_read(tmp_path: Path) -> None:
    """As rosbag leaves it when it is killed: without length of the last chunk, without index."""
    messages = Messages(ROS1)
    data = bytearray(record(tmp_path / "a.bag", messages, rows(messages, 50)).read_bytes())
    end = int.from_bytes(data[data.index(b"index_pos=") + 10 :][:8], "little")
    at = data.index(b"index_pos=") + 10
    data[at : at + 8] = bytes(8)
    (tmp_path / "run.bag.active").write_bytes(data[:end])
    read, notes = salvaged(tmp_path / "run.bag.active", tmp_path)

    assert read == 50
    assert notes == [
        "run.bag.active has no index: its recording was not finished; `rosbag reindex` may recover "
        "more"
    ]


def test_sqlite_that_is_cut_off_is_read_up_to_there(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    folder = record(tmp_path / "run", messages, rows(messages))
    [path] = folder.glob("*.db3")
    read, notes = salvaged(cut(path, 0.6).parent, tmp_path)

    assert 0.3 * COUNT < read < 0.75 * COUNT
    assert "is cut off or damaged (database disk image is malformed)" in notes[0]
    assert "`ros2 bag reindex`" in notes[0]
    assert notes[1:] == [
        f"/j: {read} of the {COUNT} messages that metadata.yaml lists were read; {COUNT - read} "
        "are missing"
    ]
    # A page that is cut off holds no wrong values.
    values = columns_of(tmp_path / "logs" / "j.csv")["j_position_a"]
    expected = [message.position[0] for _, _, message in rows(messages)]
    assert set(values) <= set(expected)


def test_sqlite_whose_journal_was_not_written_back_is_read(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    folder = record(tmp_path / "run", messages, rows(messages, 10))
    [path] = folder.glob("*.db3")
    database = sqlite3.connect(path)
    database.execute("PRAGMA journal_mode=WAL")
    database.execute(
        "INSERT INTO messages SELECT 1000, topic_id, timestamp + 1000, data FROM messages LIMIT 1"
    )
    database.commit()
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    database.close()
    assert next(copy.glob("*-wal")).stat().st_size
    [log] = unpack(copy, tmp_path / "logs", by_arrival=True)

    assert len(columns_of(log)["time"]) == 11


@pytest.mark.parametrize("mcap", [False, True])
def test_a_folder_without_metadata_is_read(tmp_path: Path, mcap: bool) -> None:
    messages = Messages(ROS2)
    folder = record(tmp_path / "run", messages, rows(messages, 10), mcap)
    (folder / "metadata.yaml").unlink()
    read, notes = salvaged(folder, tmp_path)

    assert read == 10
    assert notes == [
        "metadata.yaml is missing, so that all files of run are read in the order of their names; "
        "`ros2 bag reindex` writes it anew"
    ]


def test_one_of_several_files_that_cannot_be_read_is_left_out(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    folder = record(tmp_path / "run", messages, rows(messages, 10))
    (folder / "run_1.db3").write_bytes(b"")
    path = folder / "metadata.yaml"
    path.write_text(path.read_text().replace("- run.db3\n", "- run.db3\n  - run_1.db3\n", 1))
    read, notes = salvaged(folder, tmp_path)

    assert read == 10
    assert len(notes) == 1
    assert notes[0].startswith("run_1.db3 cannot be read as a bag: it is empty; ")


def test_a_folder_of_ros1_bags_is_read_as_one(tmp_path: Path) -> None:
    messages, (first, second) = Messages(ROS1), (tmp_path / "run" / f"{i}.bag" for i in (0, 1))
    first.parent.mkdir()
    record(first, messages, rows(messages, 10))
    record(second, messages, rows(messages, 15)[10:])
    read, notes = salvaged(first.parent, tmp_path)

    assert read == 15
    assert notes == []


@pytest.mark.parametrize(
    ("later", "expected"),
    [
        (1.0, "1.mcap begins 2.99 s before 0.mcap ends"),
        (3603.99, "1.mcap begins 3600 s after 0.mcap ends"),
        (4.0, None),
    ],
)
def test_files_that_do_not_follow_one_another_are_mentioned(
    tmp_path: Path, later: float, expected: str | None
) -> None:
    """As in a folder of recordings, each of which is a bag of its own."""
    messages = Messages(ROS2)
    (tmp_path / "run").mkdir()
    for i in (0, 1):
        recorded = [(topic, time + i * later, m) for topic, time, m in rows(messages)]
        write_mcap(tmp_path / "run" / f"{i}.mcap", ros_rows(messages, recorded))
    notes: list[str] = []
    unpack(tmp_path / "run", tmp_path / "logs", by_arrival=True, note=notes.append)

    assert [note for note in notes if "separately" in note] == [
        f"{expected}, but the files of run are read as one recording; if they are several, unpack "
        "each file separately"
    ] * (expected is not None)


def test_a_file_that_the_metadata_does_not_list_is_mentioned(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    folder = record(tmp_path / "run", messages, rows(messages, 10))
    write_mcap(folder / "other.mcap", ros_rows(messages, rows(messages, 20)))
    read, notes = salvaged(folder, tmp_path)

    assert read == 10
    assert notes == ["metadata.yaml does not list other.mcap, which is left out"]


@pytest.mark.parametrize("suffix", [".MCAP", ".DB3", ".bin"])
def test_the_format_is_found_by_the_content(tmp_path: Path, suffix: str) -> None:
    messages = Messages(ROS2)
    folder = record(tmp_path / "run", messages, rows(messages, 10), suffix == ".MCAP")
    path = next(p for p in folder.iterdir() if p.suffix in (".mcap", ".db3"))
    read, notes = salvaged(path.rename(tmp_path / f"RUN{suffix}"), tmp_path)

    assert read == 10
    assert notes == []


@pytest.mark.parametrize("mode", ["file", "message"])
def test_compressed_bags_of_ros2_are_read(tmp_path: Path, mode: str) -> None:
    messages = Messages(ROS2)
    folder = record(tmp_path / "run", messages, rows(messages, 10))
    [path] = folder.glob("*.db3")
    if mode == "file":
        path.with_name(f"{path.name}.zstd").write_bytes(zstd.compress(path.read_bytes()))
        path.unlink()
    else:
        with sqlite3.connect(path) as database:
            for number, data in database.execute("SELECT id, data FROM messages").fetchall():
                new = (zstd.compress(data), number)
                database.execute("UPDATE messages SET data = ? WHERE id = ?", new)
        database.close()
    metadata = folder / "metadata.yaml"
    text = metadata.read_text().replace("compression_format: ''", "compression_format: zstd")
    metadata.write_text(text.replace("compression_mode: ''", f"compression_mode: {mode.upper()}"))
    read, notes = salvaged(folder, tmp_path)

    assert read == 10
    assert notes == []


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.mcap", b"version https://git-lfs.github.com/spec/v1\n", "run `git lfs pull`"),
        ("a.bag", b"#ROSBAG V1.2\n", "convert it with `rosbag fix`"),
        ("a.parquet", b"PAR1....", "give it to `init`"),
        ("a.mcap", b"", "it is empty"),
        ("a.mcap", b"\x89MCAP0\r\n", "a.mcap is cut off; `mcap recover` may recover more"),
        ("a.bag", b"#ROSBAG V2.0\n" + b"\xff" * 99, "cut off or damaged; `rosbag reindex` may"),
        ("a.db3", b"SQLite format 3\0" + b"\xff" * 9999, "topics cannot be read (.*reindex"),
    ],
)
def test_what_cannot_be_read_is_refused_with_advice(
    tmp_path: Path, name: str, content: bytes, expected: str
) -> None:
    (tmp_path / name).write_bytes(content)

    with pytest.raises(StudyError, match=expected.replace("(", r"\(")) as error:
        unpack(tmp_path / name, tmp_path / "logs")
    assert str(error.value).startswith(name)
    assert not (tmp_path / "logs").exists()


def test_decompression_ends_at_a_limit() -> None:
    data = zstd.compress(bytes(1 << 20))

    assert expand("zstd", data, 1000) == (bytes(1000), False)
    assert expand("zstd", data + data, 1 << 22) == (bytes(1 << 21), True)
    with pytest.raises(CompressionError, match="valid are bz2, lz4, zstd"):
        expand("brotli", data, 1000)


def test_rows_of_sqlite_without_topic_time_or_data_are_counted(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    folder = record(tmp_path / "run", messages, rows(messages, 10))
    (folder / "metadata.yaml").unlink()
    [path] = folder.glob("*.db3")
    with sqlite3.connect(path) as database:
        for row in ("(100, 99, 5, x'00')", "(101, 1, 'x', x'00')", "(102, 1, 5, 'x')"):
            database.execute(f"INSERT INTO messages VALUES {row}")
    database.close()
    read, notes = salvaged(path, tmp_path)

    assert read == 10
    assert notes == ["3 messages of run.db3 have no topic, no time or no data"]


def test_a_compressed_file_unfolds_to_a_limit_and_once_only(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    path = record(tmp_path / "run", messages, rows(messages, 10))
    [path] = path.glob("*.db3")
    zeros = path.read_bytes() + bytes(200 << 20)
    (tmp_path / "bomb.db3.zstd").write_bytes(zstd.compress(zeros))
    (tmp_path / "twice.db3.zstd").write_bytes(zstd.compress(zstd.compress(path.read_bytes())))
    limit = files.UNFOLDED * (tmp_path / "bomb.db3.zstd").stat().st_size + (1 << 20)
    sizes = []
    sqlite = files._READERS[files.sqlite_file.MAGIC]

    def reader(path: Path, contents: Contents) -> Any:
        sizes.append(path.stat().st_size)
        return sqlite(path, contents)

    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(files._READERS, files.sqlite_file.MAGIC, reader)
        _, notes = salvaged(tmp_path / "bomb.db3.zstd", tmp_path)
    assert sizes == [limit]
    assert limit < len(zeros)
    assert "bomb.db3.zstd is cut off or damaged" in notes
    with pytest.raises(StudyError, match=r"^twice.db3.zstd is compressed twice; decompress it"):
        salvaged(tmp_path / "twice.db3.zstd", tmp_path / "twice")


def test_an_encrypted_ros1_bag_is_named(tmp_path: Path) -> None:
    messages = Messages(ROS1)
    data = record(tmp_path / "a.bag", messages, rows(messages, 10)).read_bytes()
    length = int.from_bytes(data[13:17], "little")
    field = b"encryptor=rosbag/AesCbcEncryptor"
    header = data[17 : 17 + length] + len(field).to_bytes(4, "little") + field
    new = data[:13] + len(header).to_bytes(4, "little") + header + data[17 + length :]
    (tmp_path / "run.bag").write_bytes(new)
    _, notes = salvaged(tmp_path / "run.bag", tmp_path)

    assert notes == ["run.bag is encrypted; decrypt it with `rosbag decrypt`"]


def test_the_index_of_a_ros1_bag_is_compared(tmp_path: Path) -> None:
    messages = Messages(ROS1)
    path = record(tmp_path / "run.bag", messages, rows(messages, 10))
    data = bytearray(path.read_bytes())
    assert data[-4:] == (10).to_bytes(4, "little")  # the last record counts the last chunk
    data[-4:] = (13).to_bytes(4, "little")
    path.write_bytes(data)
    _, notes = salvaged(path, tmp_path)

    assert notes == [
        "/j: 10 of the 13 messages that the index of the file lists were read; 3 are missing"
    ]


def test_files_are_read_in_the_order_of_the_metadata(tmp_path: Path) -> None:
    """``run_10`` was recorded after ``run_9``; of one time the last value stays."""
    folder = tmp_path / "run"
    folder.mkdir()
    for number in (9, 10):
        row = ("/n", "json", "", "", b"", 0.0, b'{"x": %d}' % number)
        write_mcap(folder / f"run_{number}.mcap", [row])
    text = "{rosbag2_bagfile_information: {relative_file_paths: [run_9.mcap, run_10.mcap]}}"
    (folder / "metadata.yaml").write_text(text)
    [log] = unpack(folder, tmp_path / "logs")

    assert columns_of(log)["n_x"] == [10.0]
