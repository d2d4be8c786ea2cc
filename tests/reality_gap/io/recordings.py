"""Bags that tests write: messages of ROS 1 and ROS 2, MCAP files of any encoding."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from reality_gap.io.tables import read_header, read_table

START = 1_700_000_000
"""When the recording began [s since 1970]."""
ROS1, ROS2 = Stores.ROS1_NOETIC, Stores.ROS2_HUMBLE
Recorded = tuple[str, float, Any]
"""Topic, arrival after the start [s], message."""


class Messages:
    """Makes messages of one version of ROS."""

    def __init__(self, version: Stores) -> None:
        self.store = get_typestore(version)
        self.first = version is ROS1

    def of(self, kind: str, **fields: Any) -> Any:
        return self.store.types[kind](**fields)

    def header(self, stamp: float | None) -> Any:
        seconds, rest = (0, 0) if stamp is None else divmod(round(1e9 * stamp), 10**9)
        start = 0 if stamp is None else START
        time = self.of("builtin_interfaces/msg/Time", sec=start + seconds, nanosec=rest)
        number = {"seq": 0} if self.first else {}
        return self.of("std_msgs/msg/Header", stamp=time, frame_id="", **number)

    def joints(self, stamp: float | None, names: Sequence[str], position: Sequence[float]) -> Any:
        return self.of(
            "sensor_msgs/msg/JointState",
            header=self.header(stamp),
            name=list(names),
            position=np.array(position, dtype=np.float64),
            velocity=np.zeros(0),
            effort=np.zeros(0),
        )

    def text(self, text: str) -> Any:
        return self.of("std_msgs/msg/String", data=text)

    def number(self, value: float) -> Any:
        return self.of("std_msgs/msg/Float64", data=value)

    def pose(self, stamp: float, *position: float) -> Any:
        x, y, z = position
        return self.of(
            "geometry_msgs/msg/PoseStamped",
            header=self.header(stamp),
            pose=self.of(
                "geometry_msgs/msg/Pose",
                position=self.of("geometry_msgs/msg/Point", x=x, y=y, z=z),
                orientation=self.of("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
            ),
        )

    def transform(self, stamp: float | None, parent: str, frame: str, x: float) -> Any:
        header = self.header(stamp)
        header.frame_id = parent
        return self.of(
            "geometry_msgs/msg/TransformStamped",
            header=header,
            child_frame_id=frame,
            transform=self.of(
                "geometry_msgs/msg/Transform",
                translation=self.of("geometry_msgs/msg/Vector3", x=x, y=0.0, z=0.0),
                rotation=self.of("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
            ),
        )

    def transforms(self, *transforms: Any) -> Any:
        kind = "tf2_msgs/msg/TFMessage"
        return self.of(kind, transforms=list(transforms))

    def image(self, stamp: float) -> Any:
        return self.of(
            "sensor_msgs/msg/Image",
            header=self.header(stamp),
            height=40,
            width=40,
            encoding="mono8",
            is_bigendian=0,
            step=40,
            data=np.zeros(1600, dtype=np.uint8),
        )


def joints(messages: Messages, count: int = 10) -> list[Recorded]:
    """Messages about a joint on the topic /joints, 0.1 s apart."""
    return [("/joints", 0.1 * i, messages.joints(0.1 * i, ["a"], [float(i)])) for i in range(count)]


def record(
    path: Path, messages: Messages, recorded: Sequence[Recorded], mcap: bool = False
) -> Path:
    """Write a bag: a file for ROS 1, a folder for ROS 2."""
    writer: Any
    if messages.first:
        writer = Writer1(path)
    else:
        plugin = StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
        writer = Writer2(path, version=9, storage_plugin=plugin)
    store = messages.store
    serialize = store.serialize_ros1 if messages.first else store.serialize_cdr
    with writer:
        open_: dict[str, Any] = {}
        for topic, arrival, message in recorded:
            kind = message.__msgtype__
            if topic not in open_:
                open_[topic] = writer.add_connection(topic, kind, typestore=store)
            when = START * 10**9 + round(1e9 * arrival)
            writer.write(open_[topic], when, serialize(message, kind))
    return path


def columns_of(path: Path) -> dict[str, np.ndarray]:
    """Read a log in the same way as a study."""
    return read_table(path, path.name, read_header(path, path.name)).columns


def write_mcap(path: Path, recorded: Sequence[tuple[Any, ...]], **options: Any) -> Path:
    """Write an MCAP file with the library mcap.

    Args:
        path: the file.
        recorded: topic, encoding of the messages, name, encoding and text of the type, arrival
            after the start [s], encoded message.
        options: options of `mcap.writer.Writer`.
    """
    with path.open("wb") as file:
        writer = McapWriter(file, **options)
        writer.start(profile="", library="test")
        channels: dict[tuple[Any, ...], int] = {}
        for topic, encoding, kind, format_, definition, arrival, data in recorded:
            key = (topic, encoding, kind)
            if key not in channels:
                schema = writer.register_schema(kind, format_, definition) if kind else 0
                channels[key] = writer.register_channel(topic, encoding, schema)
            when = START * 10**9 + round(1e9 * arrival)
            writer.add_message(channels[key], when, data, when)
        writer.finish()
    return path


def ros_rows(
    messages: Messages, recorded: Sequence[Recorded], embedded: bool = True
) -> list[tuple[Any, ...]]:
    """Messages of ROS as rows for `write_mcap`."""
    store, rows = messages.store, []
    encoding, format_ = ("ros1", "ros1msg") if messages.first else ("cdr", "ros2msg")
    serialize = store.serialize_ros1 if messages.first else store.serialize_cdr
    for topic, arrival, message in recorded:
        kind = message.__msgtype__
        text = store.generate_msgdef(kind, ros_version=1 if messages.first else 2)[0]
        name = kind.replace("/msg/", "/") if messages.first else kind
        format_or_none, definition = (format_, text.encode()) if embedded else ("", b"")
        data = bytes(serialize(message, kind))
        rows.append((topic, encoding, name, format_or_none, definition, arrival, data))
    return rows
