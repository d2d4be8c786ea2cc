"""Names in messages: what has a name has columns of its own, wherever it stands."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from reality_gap.io.rosbag import unpack
from tests.reality_gap.io.recordings import (
    ROS1,
    ROS2,
    Messages,
    Recorded,
    columns_of,
    record,
    write_mcap,
)

JSON = ("json", "", "", b"")


def unpacked(folder: Path, messages: Messages, recorded: list[Recorded]) -> dict[str, np.ndarray]:
    """Columns of the only topic of a recording."""
    name = "run.bag" if messages.first else "run"
    [path] = unpack(record(folder / name, messages, recorded), folder / "logs")
    return columns_of(path)


def json_rows(topic: str, *messages: str) -> list[tuple[Any, ...]]:
    """Messages in JSON, 0.1 s apart."""
    return [(topic, *JSON, 0.1 * i, text.encode()) for i, text in enumerate(messages)]


def test_two_frames_that_take_turns_in_tf_have_a_column_each(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    recorded = []
    for i in range(10):
        frame = "hand" if i % 2 == 0 else "elbow"
        transform = messages.transform(0.1 * i, "world", frame, 1.0 if frame == "hand" else 2.0)
        recorded.append(("/tf", 0.1 * i + 0.01, messages.transforms(transform)))

    table = unpacked(tmp_path, messages, recorded)

    name = "tf_transforms_world_{}_transform_translation_x"
    expected = {"hand": [1.0, np.nan] * 5, "elbow": [np.nan, 2.0] * 5}
    for frame, values in expected.items():
        np.testing.assert_array_equal(table[name.format(frame)], values)
    # Each transform has the time of its own stamp, not that of its arrival.
    np.testing.assert_allclose(table["time"], 0.1 * np.arange(10), atol=1e-9)
    assert not [column for column in table if column.endswith("_0_transform_translation_x")]


def test_transforms_of_one_message_and_of_two_at_one_time_are_one_row(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    hand = messages.transform(0.0, "world", "hand", 1.0)
    elbow = messages.transform(0.0, "world", "elbow", 2.0)
    later = messages.transform(0.5, "world", "hand", 3.0)
    recorded = [
        ("/tf", 0.0, messages.transforms(hand)),
        ("/tf", 0.0, messages.transforms(elbow, later)),
    ]
    table = unpacked(tmp_path, messages, recorded)

    np.testing.assert_allclose(table["time"], [0.0, 0.5], atol=1e-9)
    np.testing.assert_array_equal(table["tf_transforms_world_hand_transform_translation_x"], [1, 3])
    np.testing.assert_array_equal(
        table["tf_transforms_world_elbow_transform_translation_x"], [2.0, np.nan]
    )


def test_one_topic_with_poses_in_two_frames_has_columns_for_each(tmp_path: Path) -> None:
    messages = Messages(ROS1)
    recorded = [
        ("/marker", 0.1 * i, messages.transform(0.1 * i, "camera", f"tag_{i % 2}", float(i)))
        for i in range(4)
    ]
    table = unpacked(tmp_path, messages, recorded)

    for tag, values in {0: [0, np.nan, 2, np.nan], 1: [np.nan, 1, np.nan, 3]}.items():
        column = f"marker_tag_{tag}_transform_translation_x"
        np.testing.assert_array_equal(table[column], values)


def test_joints_that_change_order_and_number_keep_their_columns(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    sets = [(["a", "b"], [1.0, 2.0]), (["b", "a"], [2.0, 1.0]), (["b"], [2.0]), (["a"], [1.0])]
    recorded = [("/j", 0.1 * i, messages.joints(0.1 * i, *one)) for i, one in enumerate(sets)]

    table = unpacked(tmp_path, messages, recorded)

    assert set(table) == {"time", "j_position_a", "j_position_b"}
    np.testing.assert_array_equal(table["j_position_a"], [1.0, 1.0, np.nan, 1.0])
    np.testing.assert_array_equal(table["j_position_b"], [2.0, 2.0, 2.0, np.nan])


def test_interfaces_of_joints_have_the_names_of_both(tmp_path: Path) -> None:
    """As in control_msgs/DynamicJointState."""
    text = """{"joint_names": [%s], "interface_values": [%s]}"""
    elbow = '{"interface_names": ["position", "effort"], "values": [1, 2]}'
    wrist = '{"interface_names": ["effort", "position"], "values": [4, 3]}'
    rows = json_rows(
        "/dynamic",
        text % ('"elbow", "wrist"', f"{elbow}, {wrist}"),
        text % ('"wrist", "elbow"', f"{wrist}, {elbow}"),
    )
    [path] = unpack(write_mcap(tmp_path / "run.mcap", rows), tmp_path / "logs")
    table = columns_of(path)

    expected = {"elbow_values_position": 1, "elbow_values_effort": 2}
    expected |= {"wrist_values_position": 3, "wrist_values_effort": 4}
    assert {c: set(v) for c, v in table.items() if c != "time"} == {
        f"dynamic_interface_values_{name}": {value} for name, value in expected.items()
    }


def test_points_of_a_trajectory_are_not_named_after_joints(tmp_path: Path) -> None:
    """Two joints and two points: the points are in order, and their positions have the names."""
    text = '{"joint_names": ["a", "b"], "points": [{"positions": [1, 2]}, {"positions": [3, 4]}]}'
    [path] = unpack(write_mcap(tmp_path / "run.mcap", json_rows("/t", text)), tmp_path / "logs")

    columns = columns_of(path)
    assert {name: float(value[0]) for name, value in columns.items() if name != "time"} == {
        "t_points_0_positions_a": 1.0,
        "t_points_0_positions_b": 2.0,
        "t_points_1_positions_a": 3.0,
        "t_points_1_positions_b": 4.0,
    }


def test_markers_that_come_and_go_are_distinguished_by_their_numbers(tmp_path: Path) -> None:
    rows = json_rows(
        "/tags",
        '{"detections": [{"id": 7, "x": 0.7}, {"id": 3, "x": 0.3}]}',
        '{"detections": [{"id": 3, "x": 0.3}]}',
        '{"detections": [{"id": [3, 4], "x": 0.34}]}',
    )
    [path] = unpack(write_mcap(tmp_path / "run.mcap", rows), tmp_path / "logs")
    table = columns_of(path)

    np.testing.assert_array_equal(table["tags_detections_3_x"], [0.3, 0.3, np.nan])
    np.testing.assert_array_equal(table["tags_detections_7_x"], [0.7, np.nan, np.nan])


def test_elements_without_names_whose_number_changes_are_mentioned(tmp_path: Path) -> None:
    """As in geometry_msgs/PoseArray."""
    rows = json_rows("/poses", '{"poses": [{"x": 1}, {"x": 2}]}', '{"poses": [{"x": 2}]}')
    notes: list[str] = []
    unpack(write_mcap(tmp_path / "run.mcap", rows), tmp_path / "logs", note=notes.append)

    assert notes == [
        "/poses: the elements of poses have no names, and there are 1 to 2 of them; the columns "
        "follow their order in each message"
    ]


def test_names_that_would_be_one_column_are_kept_apart(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    joints = messages.joints(0.0, ["left/elbow", "left_elbow"], [1.0, 2.0])
    notes: list[str] = []
    bag = record(tmp_path / "run", messages, [("/j", 0.0, joints)])
    [path] = unpack(bag, tmp_path / "logs", note=notes.append)

    table = columns_of(path)
    assert table["j_position_left_elbow"] == [1.0]
    assert table["j_position_left_elbow_2"] == [2.0]
    assert notes == ["/j: more than one column would be j_position_left_elbow; they are numbered"]


def test_names_that_are_more_or_fewer_than_the_numbers_are_mentioned(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    notes: list[str] = []
    recorded = [("/j", 0.1 * i, messages.joints(0.1 * i, ["a", "b"], [1.0])) for i in range(2)]
    [path] = unpack(record(tmp_path / "run", messages, recorded), tmp_path / "o", note=notes.append)

    assert set(columns_of(path)) == {"time", "j_position_0"}
    assert notes == [
        "/j: position has 1 elements, but the message lists 2 names; its columns are numbered"
    ]
