"""Times of messages: wrong, missing, of other clocks, going back or equal."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from reality_gap.io.rosbag import unpack
from tests.reality_gap.io.recordings import (
    ROS2,
    START,
    Messages,
    columns_of,
    joints,
    record,
    write_mcap,
)


def test_a_message_of_an_impossible_time_is_left_out(tmp_path: Path) -> None:
    text = b'{"timestamp": {"sec": %d, "nsec": 0}, "x": 1}'
    rows = [
        ("/j", "json", "", "", b"", 0.0, text % (START + i + 10**20 * (i == 1))) for i in range(3)
    ]
    notes: list[str] = []
    unpack(write_mcap(tmp_path / "run.mcap", rows), tmp_path / "logs", note=notes.append)

    assert notes == [
        "/j: 1 of 3 messages cannot be decoded and are left out (a time is out of range)"
    ]


def test_times_of_arrival_instead_of_a_missing_stamp_are_mentioned(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    recorded = joints(messages, 4)
    recorded[0] = ("/joints", 0.0, messages.joints(None, ["a"], [0.0]))
    notes: list[str] = []
    unpack(record(tmp_path / "run", messages, recorded), tmp_path / "logs", note=notes.append)

    assert notes == [
        "/joints: 1 of 4 messages have no time stamp, so that the times of arrival are used for all"
    ]


def test_stamps_of_a_simulation_beside_times_of_arrival_are_mentioned(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    recorded: list[Any] = [
        ("/sim", 0.1 * i, messages.joints(0.1 * i + 5.0 - START, ["a"], [0.0])) for i in range(3)
    ]
    recorded += [("/wall", 0.1 * i, messages.number(1.0)) for i in range(3)]
    notes: list[str] = []
    bag = record(tmp_path / "run", messages, recorded)
    unpack(bag, tmp_path / "logs", note=notes.append)

    [note] = notes
    assert "their stamps are of different clocks; use --arrival" in note
    assert "/sim" in note
    assert "/wall" in note


def test_stamps_that_go_back_and_rows_that_are_overwritten_are_noted(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    stamps = [0.1 * i - (0.5 if i >= 6 else 0.0) for i in range(10)]
    rows = [
        ("/joints", 0.1 * i, messages.joints(stamp, ["a"], [float(i)]))
        for i, stamp in enumerate(stamps)
    ]
    folder = record(tmp_path / "run", messages, rows, mcap=True)

    notes: list[str] = []
    unpack(folder, tmp_path / "logs", note=notes.append)
    assert any("/joints go back 1 times, by up to 0.4 s" in note for note in notes)
    assert any("4 messages of /joints were overwritten" in note for note in notes)

    notes.clear()
    [log] = unpack(folder, tmp_path / "arrival", by_arrival=True, note=notes.append)
    assert notes == []
    assert len(columns_of(log)["time"]) == 10


def test_transforms_that_share_a_time_overwrite_nothing(tmp_path: Path) -> None:
    """Times of a transform are compared with those of the same transform only."""
    messages = Messages(ROS2)
    recorded = [
        ("/tf", 0.1 * i, messages.transforms(messages.transform(stamp, "world", frame, 0.0)))
        for i, (stamp, frame) in enumerate([(0.2, "hand"), (0.1, "elbow"), (0.2, "elbow")])
    ]
    notes: list[str] = []
    unpack(record(tmp_path / "run", messages, recorded), tmp_path / "logs", note=notes.append)

    assert notes == []


def test_times_of_recording_that_go_back_are_noted_without_advice(tmp_path: Path) -> None:
    rows = [("/n", "json", "", "", b"", arrival, b'{"x": 1}') for arrival in (0.0, 0.3, 0.1)]
    notes: list[str] = []
    bag = write_mcap(tmp_path / "run.mcap", rows)
    unpack(bag, tmp_path / "logs", by_arrival=True, note=notes.append)

    assert notes == ["the times of /n go back 1 times, by up to 0.2 s; the rows are sorted by time"]
