"""Messages of ROS 1, JSON and Protobuf in MCAP files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reality_gap.errors import StudyError
from reality_gap.io.rosbag import unpack
from tests.reality_gap.io.recordings import (
    ROS1,
    START,
    Messages,
    columns_of,
    joints,
    ros_rows,
    write_mcap,
)


def test_ros1_in_mcap_is_read(tmp_path: Path) -> None:
    messages = Messages(ROS1)
    bag = write_mcap(tmp_path / "run.mcap", ros_rows(messages, joints(messages)))

    [log] = unpack(bag, tmp_path / "logs")

    np.testing.assert_allclose(columns_of(log)["joints_position_a"], np.arange(10.0))


def test_json_in_mcap_is_read_with_its_stamps(tmp_path: Path) -> None:
    text = '{"timestamp": {"sec": %d, "nsec": 500000000}, "names": ["a"], "q": [%d], "on": true}'
    rows = [
        ("/j", "json", "State", "jsonschema", b"{}", 0.1 * i, (text % (START + i, i)).encode())
        for i in range(3)
    ]
    [log] = unpack(write_mcap(tmp_path / "run.mcap", rows), tmp_path / "logs")

    table = columns_of(log)
    assert set(table) == {"time", "j_q_a", "j_on"}
    np.testing.assert_allclose(table["time"], [0.0, 1.0, 2.0])
    np.testing.assert_allclose(table["j_q_a"], [0.0, 1.0, 2.0])


def test_numbers_that_are_not_finite_are_counted(tmp_path: Path) -> None:
    texts = [b'{"x": NaN, "y": 1}', b'{"x": Infinity, "y": 2}', b'{"x": 1e999, "y": NaN}']
    rows = [("/j", "json", "", "", b"", 0.1 * i, text) for i, text in enumerate(texts)]
    notes: list[str] = []
    [log] = unpack(write_mcap(tmp_path / "run.mcap", rows), tmp_path / "logs", note=notes.append)

    np.testing.assert_array_equal(columns_of(log)["j_y"], [1.0, 2.0, np.nan])
    assert notes == [
        "/j: 4 numbers are NaN or infinite; their cells are empty; no number is left in j_x"
    ]


def test_protobuf_in_mcap_is_read(tmp_path: Path) -> None:
    definition, make = joint_states()
    rows = [
        ("/j", "protobuf", "robot.JointStates", "protobuf", definition, 0.1 * i, make(i))
        for i in range(3)
    ]
    [log] = unpack(write_mcap(tmp_path / "run.mcap", rows), tmp_path / "logs")

    table = columns_of(log)
    np.testing.assert_allclose(table["time"], [0.0, 1.0, 2.0])
    np.testing.assert_allclose(table["j_joints_elbow_position"], [0.0, 1.0, 2.0])
    np.testing.assert_allclose(table["j_joints_wrist_position"], [0.5, 1.5, 2.5])


def test_protobuf_without_its_definition_is_left_out(tmp_path: Path) -> None:
    rows = [("/j", "protobuf", "robot.JointStates", "protobuf", b"\xff\xff", 0.0, b"")]

    with pytest.raises(StudyError, match=r"the definition of its type robot.JointStates is"):
        unpack(write_mcap(tmp_path / "run.mcap", rows), tmp_path / "logs")


def joint_states() -> tuple[bytes, Any]:
    """A FileDescriptorSet, and what makes a message of it."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2

    file = descriptor_pb2.FileDescriptorProto(
        name="robot.proto",
        package="robot",
        syntax="proto3",
        dependency=["google/protobuf/timestamp.proto"],
    )
    kind = descriptor_pb2.FieldDescriptorProto
    joint = file.message_type.add(name="Joint")
    joint.field.add(name="name", number=1, type=kind.TYPE_STRING, label=kind.LABEL_OPTIONAL)
    joint.field.add(name="position", number=2, type=kind.TYPE_DOUBLE, label=kind.LABEL_OPTIONAL)
    states = file.message_type.add(name="JointStates")
    states.field.add(
        name="timestamp",
        number=1,
        type=kind.TYPE_MESSAGE,
        type_name=".google.protobuf.Timestamp",
        label=kind.LABEL_OPTIONAL,
    )
    states.field.add(
        name="joints",
        number=2,
        type=kind.TYPE_MESSAGE,
        type_name=".robot.Joint",
        label=kind.LABEL_REPEATED,
    )
    stamp = descriptor_pb2.FileDescriptorProto()
    timestamp_pb2.DESCRIPTOR.CopyToProto(stamp)
    files = descriptor_pb2.FileDescriptorSet(file=[file, stamp])
    pool = descriptor_pool.DescriptorPool()
    pool.Add(stamp)
    pool.Add(file)
    type_ = message_factory.GetMessageClass(pool.FindMessageTypeByName("robot.JointStates"))

    def make(i: int) -> bytes:
        message: Any = type_()
        message.timestamp.seconds = START + i
        for name, position in (("elbow", i), ("wrist", i + 0.5))[:: 1 if i % 2 else -1]:
            message.joints.add(name=name, position=position)
        return bytes(message.SerializeToString())

    return files.SerializeToString(), make
