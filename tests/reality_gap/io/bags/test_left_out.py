"""Each topic of a bag is read separately; what is left out or missing is said with the reason."""

from __future__ import annotations

import re
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from reality_gap.__main__ import main
from reality_gap.errors import StudyError
from reality_gap.io.rosbag import unpack
from tests.reality_gap.io.recordings import (
    ROS2,
    START,
    Messages,
    columns_of,
    joints,
    record,
    ros_rows,
    write_mcap,
)

EVENT = "std_srvs/srv/SetBool_Event"


def strange(arrival: float, topic: str = "/strange", kind: str = "my_msgs/msg/Gripper") -> Any:
    """A message of an unknown type, whose definition is not in the bag."""
    return (topic, "cdr", kind, "", b"", arrival, b"\0\1\0\0" + np.float64(arrival).tobytes())


def test_a_folder_whose_metadata_and_channel_differ_in_qos_is_read(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    folder = record(tmp_path / "run", messages, joints(messages), mcap=True)
    path = folder / "metadata.yaml"
    metadata = yaml.safe_load(path.read_text())
    topic = metadata["rosbag2_bagfile_information"]["topics_with_message_count"][0]
    never = {"sec": 9223372036, "nsec": 854775807}
    times = dict.fromkeys(("deadline", "lifespan", "liveliness_lease_duration"), never)
    names = {"history": "keep_last", "reliability": "best_effort", "durability": "volatile"}
    others = {"depth": 5, "liveliness": "automatic", "avoid_ros_namespace_conventions": False}
    topic["topic_metadata"]["offered_qos_profiles"] = [{**names, **times, **others}]
    path.write_text(yaml.safe_dump(metadata))

    notes: list[str] = []
    [log] = unpack(folder, tmp_path / "logs", note=notes.append)

    assert len(columns_of(log)["time"]) == 10
    assert notes == []


@pytest.mark.parametrize("mcap", [False, True])
@pytest.mark.parametrize(
    ("count", "expected"),
    [
        (13, "/joints: 10 of the 13 messages that metadata.yaml lists were read; 3 are missing"),
        (7, "/joints: 10 messages were read, more than the 7 in metadata.yaml"),
    ],
)
def test_a_different_message_count_is_reported_with_the_number(
    tmp_path: Path, mcap: bool, count: int, expected: str
) -> None:
    messages = Messages(ROS2)
    folder = record(tmp_path / "run", messages, joints(messages), mcap)
    path = folder / "metadata.yaml"
    path.write_text(path.read_text().replace("message_count: 10", f"message_count: {count}"))

    notes: list[str] = []
    unpack(folder, tmp_path / "logs", note=notes.append)

    assert notes == [expected]


def test_the_statistics_of_an_mcap_file_are_compared(tmp_path: Path) -> None:
    """The file lacks a chunk that its statistics count."""
    messages = Messages(ROS2)
    rows = ros_rows(messages, joints(messages))
    whole = write_mcap(tmp_path / "run.mcap", rows, chunk_size=100, enable_crcs=False).read_bytes()
    at = [m.start() for m in re.finditer(b"\x06", whole) if _is_chunk(whole, m.start())][3]
    length = int.from_bytes(whole[at + 1 : at + 9], "little")
    (tmp_path / "run.mcap").write_bytes(whole[:at] + whole[at + 9 + length :])

    notes: list[str] = []
    [log] = unpack(tmp_path / "run.mcap", tmp_path / "logs", note=notes.append)

    read = len(columns_of(log)["time"])
    assert 0 < read < 10
    assert notes == [
        f"/joints: {read} of the 10 messages that the summary of the file lists were read; "
        f"{10 - read} are missing"
    ]


def _is_chunk(data: bytes, at: int) -> bool:
    start, end = (int.from_bytes(data[at + i : at + i + 8], "little") for i in (9, 17))
    return START * 10**9 <= start <= end < (START + 10) * 10**9 and len(data) > at + 25


@pytest.mark.parametrize("topics", [[], ["/joints"]])
def test_unknown_types_events_and_json_do_not_make_a_bag_unreadable(
    tmp_path: Path, topics: list[str]
) -> None:
    messages = Messages(ROS2)
    rows = ros_rows(messages, joints(messages))
    rows += [strange(0.1 * i) for i in range(3)]
    rows += [strange(0.1 * i, "/service/_service_event", EVENT) for i in range(3)]
    rows += [("/json", "json", "", "", b"", 0.1 * i, b'{"q": [1, 2.5]}') for i in range(3)]
    rows += [("/cbor", "cbor", "", "", b"", 0.1, b"\xa0")]
    bag = write_mcap(tmp_path / "run.mcap", rows)

    notes: list[str] = []
    logs = unpack(bag, tmp_path / "logs", topics, note=notes.append)

    if topics:
        assert [log.name for log in logs] == ["joints.csv"]
        assert notes == []
        return
    assert [log.name for log in logs] == ["joints.csv", "json.csv"]
    assert set(columns_of(logs[1])) == {"time", "json_q_0", "json_q_1"}
    assert notes == [
        "/cbor is left out: its messages are encoded as 'cbor'; valid are cdr, ros1, json, "
        "protobuf",
        f"/service/_service_event is left out: its messages are of the type {EVENT}, an event of a "
        "service or an action, which holds no measurement",
        "/strange is left out: its type my_msgs/msg/Gripper is not known, and the bag holds no "
        "definition of it; give a folder with its .msg or .idl file by --types",
    ]


def test_a_bag_whose_only_topic_cannot_be_read_is_refused_with_the_reason(tmp_path: Path) -> None:
    bag = write_mcap(tmp_path / "run.mcap", [strange(0.0)])

    with pytest.raises(StudyError, match=r"/strange is left out: its type my_msgs/msg/Gripper is"):
        unpack(bag, tmp_path / "logs")


def test_unknown_types_in_an_sqlite_bag(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    folder = record(tmp_path / "run", messages, joints(messages))
    [path] = folder.glob("*.db3")
    with sqlite3.connect(path) as database:
        values = (99, "/strange", "my_msgs/msg/Gripper", "cdr", "", "")
        database.execute("INSERT INTO topics VALUES (?, ?, ?, ?, ?, ?)", values)
        database.execute("INSERT INTO messages VALUES (1000, 99, 5, x'0001000000')")
    database.close()

    notes: list[str] = []
    logs = unpack(folder, tmp_path / "logs", note=notes.append)

    assert [log.name for log in logs] == ["joints.csv"]
    assert any(
        "/strange is left out: its type my_msgs/msg/Gripper is not known" in n for n in notes
    )


@pytest.mark.parametrize("layout", ["my_msgs/msg/Gripper.msg", "my_msgs/Gripper.msg", "idl"])
def test_definitions_of_messages_can_be_given(tmp_path: Path, layout: str) -> None:
    types = tmp_path / "types"
    path = types / ("my_msgs/msg/Gripper.idl" if layout == "idl" else layout)
    path.parent.mkdir(parents=True)
    idl = "module my_msgs { module msg { struct Gripper { double opening; }; }; };"
    path.write_text(idl if layout == "idl" else "float64 opening\n")
    bag = write_mcap(tmp_path / "run.mcap", [strange(0.1 * i) for i in range(3)])

    unpack(bag, tmp_path / "logs", types=types)

    table = columns_of(tmp_path / "logs" / "strange.csv")
    np.testing.assert_allclose(table["strange_opening"], [0.0, 0.1, 0.2])


def test_definitions_are_given_on_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = write_mcap(tmp_path / "run.mcap", [strange(0.0)])
    arguments = ["unpack", str(bag), "--out", str(tmp_path / "logs"), "--types"]

    assert main([*arguments, str(tmp_path / "types")]) == 2
    assert "there is no folder" in capsys.readouterr().err
    (tmp_path / "types" / "my_msgs").mkdir(parents=True)
    (tmp_path / "types" / "my_msgs" / "Gripper.msg").write_text("float64 opening\n")
    assert main([*arguments, str(tmp_path / "types")]) == 0
    assert (tmp_path / "logs" / "strange.csv").is_file()


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("", "", "holds no .msg or .idl file"),
        ("p/msg/A.msg", "float64 = x [", "A.msg is no definition of a message"),
        ("my_msgs/msg/Gripper.msg", "other_msgs/Finger finger", "needs other_msgs/msg/Finger"),
    ],
)
def test_definitions_that_do_not_help_are_refused_with_the_reason(
    tmp_path: Path, name: str, text: str, expected: str
) -> None:
    types = tmp_path / "types"
    types.mkdir()
    if name:
        (types / name).parent.mkdir(parents=True)
        (types / name).write_text(text)
    bag = write_mcap(tmp_path / "run.mcap", [strange(0.0)])

    with pytest.raises(StudyError, match=expected):
        unpack(bag, tmp_path / "logs", types=types)


def test_messages_that_do_not_fit_their_definition_are_counted(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    rows = ros_rows(messages, joints(messages))
    rows[3] = (*rows[3][:-1], b"\0\1\0\0\1")
    notes: list[str] = []
    [log] = unpack(write_mcap(tmp_path / "run.mcap", rows), tmp_path / "logs", note=notes.append)

    assert len(columns_of(log)["time"]) == 9
    [note] = notes
    assert note.startswith("/joints: 1 of 10 messages cannot be decoded and are left out (")


def test_a_link_out_of_the_folder_of_definitions_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "secret.msg").write_text("float64 opening\n")
    (tmp_path / "types" / "my_msgs").mkdir(parents=True)
    (tmp_path / "types" / "my_msgs" / "Gripper.msg").symlink_to(tmp_path / "secret.msg")
    bag = write_mcap(tmp_path / "run.mcap", [strange(0.0)])

    with pytest.raises(StudyError, match=r"Gripper.msg is a link out of .*/types, or larger than"):
        unpack(bag, tmp_path / "logs", types=tmp_path / "types")


def test_a_topic_with_too_many_columns_is_mentioned(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    recorded = [
        ("/tag", 0.01 * i, messages.transform(0.01 * i, "camera", f"tag_{i}", float(i)))
        for i in range(257)
    ]
    notes: list[str] = []
    bag = record(tmp_path / "run", messages, recorded)
    unpack(bag, tmp_path / "logs", note=notes.append)

    assert notes[0] == (
        "/tag: its messages are about 257 different things, more than 256; its columns mix them"
    )
