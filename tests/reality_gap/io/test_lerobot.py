"""LeRobot datasets of the versions 2 and 3 become a table for each episode."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

from reality_gap.__main__ import main
from reality_gap.errors import StudyError
from reality_gap.io.lerobot import unpack_dataset
from tests.reality_gap.io.recordings import columns_of

JOINTS = ["shoulder_pan.pos", "gripper.pos"]
LENGTHS = (30, 50, 40)
"""Number of frames of each episode."""


def write_dataset(
    folder: Path, version: int, names: Any = JOINTS, cut: tuple[float, int] | None = None
) -> Path:
    """Write a dataset of three episodes at 50 Hz."""
    arrays = {"dtype": "float32", "shape": [2], "names": names}
    info = {
        "codebase_version": "v2.1" if version == 2 else "v3.0",
        "fps": 50,
        "total_episodes": len(LENGTHS),
        "total_frames": sum(LENGTHS),
        "features": {
            "action": arrays,
            "observation.state": arrays,
            "observation.images.top": {"dtype": "video", "shape": [480, 640, 3]},
            "timestamp": {"dtype": "float32", "shape": [1], "names": None},
        },
    }
    (folder / "meta").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    tables = []
    for episode, length in enumerate(LENGTHS):
        time = np.arange(length) / 50
        state = np.stack([time + episode, -time], axis=1).astype(np.float32)
        array = pa.list_(pa.float32(), 2) if version == 3 else pa.list_(pa.float32())
        columns = {
            "action": pa.array((state + 10).tolist(), array),
            "observation.state": pa.array(state.tolist(), array),
            "timestamp": pa.array(time.astype(np.float32)),
            "frame_index": pa.array(np.arange(length)),
            "episode_index": pa.array(np.full(length, episode)),
            "index": pa.array(np.arange(length)),
            "task_index": pa.array(np.zeros(length, dtype=int)),
            "next.reward": pa.array(np.ones(length, dtype=np.float32)),
        }
        tables.append(pa.table(columns))
    data = folder / "data" / "chunk-000"
    data.mkdir(parents=True)
    if version == 3:
        episodes = folder / "meta" / "episodes" / "chunk-000"
        episodes.mkdir(parents=True)
        rows = pa.table({"episode_index": [0, 1, 2], "length": list(LENGTHS)})
        pyarrow.parquet.write_table(rows, episodes / "file-000.parquet")
        # Row groups do not end where episodes do.
        whole = pa.concat_tables(tables)
        pyarrow.parquet.write_table(whole, data / "file-000.parquet", row_group_size=37)
    else:
        for episode, table in enumerate(tables):
            pyarrow.parquet.write_table(table, data / f"episode_{episode:06d}.parquet")
    return folder


@pytest.mark.parametrize("version", [2, 3])
def test_each_episode_becomes_a_table_with_the_names_of_the_joints(
    tmp_path: Path, version: int
) -> None:
    dataset = write_dataset(tmp_path / "so101", version)
    notes: list[str] = []

    written = unpack_dataset(dataset, tmp_path / "logs", note=notes.append)

    assert [path.name for path in written] == [f"episode_{i:06d}.csv" for i in range(3)]
    for episode, path in enumerate(written):
        table, time = columns_of(path), np.arange(LENGTHS[episode]) / 50
        assert set(table) == {
            "time",
            *(
                f"{feature}.{joint}"
                for feature in ("action", "observation.state")
                for joint in JOINTS
            ),
            "next.reward",
        }
        np.testing.assert_allclose(table["time"], time, atol=1e-6)
        np.testing.assert_allclose(table["action.gripper.pos"], 10 - time, atol=1e-5)
        state = table["observation.state.shoulder_pan.pos"]
        np.testing.assert_allclose(state, time + episode, atol=1e-5)
    assert notes == ["left out, as they hold no numbers: observation.images.top"]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ({"motors": JOINTS}, JOINTS),
        ({"shoulder_pan.pos": 0, "gripper.pos": 1}, JOINTS),
        (None, ["0", "1"]),
        (["too", "many", "names"], ["0", "1"]),
        (["same", "same"], ["0", "1"]),
    ],
)
def test_names_of_entries_in_all_their_forms(
    tmp_path: Path, names: Any, expected: list[str]
) -> None:
    notes: list[str] = []
    dataset = write_dataset(tmp_path / "set", 2, names)
    written = unpack_dataset(dataset, tmp_path / "logs", ["action"], [1], note=notes.append)

    assert [path.name for path in written] == ["episode_000001.csv"]
    assert list(columns_of(written[0])) == ["time", *(f"action.{name}" for name in expected)]
    assert any("does not name the entries of action" in n for n in notes) == ("0" in expected)


def test_a_damaged_file_is_left_out_and_the_difference_is_reported(tmp_path: Path) -> None:
    dataset = write_dataset(tmp_path / "set", 2)
    path = dataset / "data" / "chunk-000" / "episode_000001.parquet"
    path.write_bytes(path.read_bytes()[:500])
    notes: list[str] = []
    written = unpack_dataset(dataset, tmp_path / "logs", note=notes.append)

    assert [path.name for path in written] == ["episode_000000.csv", "episode_000002.csv"]
    assert notes[0].startswith("episode_000001.parquet is cut off or damaged and was left out (")
    assert notes[1:3] == [
        "2 episodes were read, but meta/info.json counts 3",
        "70 frames were read, but meta/info.json counts 120",
    ]


def test_large_arrays_and_numbers_that_are_missing_are_mentioned(tmp_path: Path) -> None:
    dataset = write_dataset(tmp_path / "set", 2)
    path = dataset / "data" / "chunk-000" / "episode_000000.parquet"
    table, rows = pyarrow.parquet.read_table(path), LENGTHS[0]
    wide = pa.array([[0.0] * 1025] * rows, pa.list_(pa.float32()))
    holes = pa.array([None, np.nan, np.inf, *[1.0] * (rows - 3)])
    table = table.append_column("tactile", wide).append_column("holes", holes)
    pyarrow.parquet.write_table(table, path)
    info = json.loads((dataset / "meta" / "info.json").read_text())
    info["features"]["tactile"] = {"dtype": "float32", "shape": [1025]}
    (dataset / "meta" / "info.json").write_text(json.dumps(info))
    notes: list[str] = []
    [log] = unpack_dataset(dataset, tmp_path / "logs", episodes=[0], note=notes.append)

    np.testing.assert_array_equal(columns_of(log)["holes"][:4], [np.nan] * 3 + [1.0])
    assert notes[1:] == [
        "left out, as no file holds them, or they have more than 1024 entries: tactile",
        "3 numbers are missing, NaN or infinite; their cells are empty",
    ]


def test_frames_are_ordered_by_time_and_arrays_keep_their_size(tmp_path: Path) -> None:
    dataset = write_dataset(tmp_path / "set", 2)
    path = dataset / "data" / "chunk-000" / "episode_000000.parquet"
    table = pyarrow.parquet.read_table(path)
    pyarrow.parquet.write_table(table.take(np.arange(LENGTHS[0])[::-1]), path)
    [log] = unpack_dataset(dataset, tmp_path / "logs", episodes=[0])
    np.testing.assert_allclose(columns_of(log)["time"], np.arange(LENGTHS[0]) / 50, atol=1e-6)

    sizes = pa.array([[1.0], [1.0, 2.0], *[[1.0]] * (LENGTHS[0] - 2)])
    pyarrow.parquet.write_table(table.set_column(0, "action", sizes), path)
    with pytest.raises(StudyError, match="the feature action has 1 to 2 entries in one episode"):
        unpack_dataset(dataset, tmp_path / "again")


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--topics", "actions"], r"unknown feature 'actions'; known: action, observation.state"),
        (["--episodes", "7"], r"set has no episode 7; it has 0 to 2"),
    ],
)
def test_what_a_dataset_does_not_hold(
    tmp_path: Path, options: list[str], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    dataset = write_dataset(tmp_path / "set", 3)

    assert main(["unpack", str(dataset), "--out", str(tmp_path / "logs"), *options]) == 2
    assert expected in capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ({"meta/info.json": "[]"}, "meta/info.json is not that of a LeRobot dataset"),
        ({"meta/info.json": '{"features": {}}'}, "has no Parquet file below set/data"),
    ],
)
def test_a_folder_that_is_no_dataset(
    tmp_path: Path, content: dict[str, str], expected: str
) -> None:
    for name, text in content.items():
        (tmp_path / "set" / name).parent.mkdir(parents=True)
        (tmp_path / "set" / name).write_text(text)

    with pytest.raises(StudyError, match=expected):
        unpack_dataset(tmp_path / "set", tmp_path / "logs")


def test_from_a_dataset_to_a_draft(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dataset = write_dataset(tmp_path / "set", 3)
    (tmp_path / "m.xml").write_text(
        """<mujoco><worldbody><body><joint name="shoulder_pan" axis="0 1 0"/>
        <geom size=".1" pos=".2 0 0"/></body></worldbody>
        <actuator><position name="shoulder_pan" joint="shoulder_pan"/></actuator>
        <sensor><jointpos name="shoulder_pan_position" joint="shoulder_pan"/></sensor></mujoco>"""
    )
    logs = tmp_path / "logs"
    assert main(["unpack", str(dataset), "--out", str(logs), "--episodes", "0", "1"]) == 0
    paths = [str(path) for path in sorted(logs.glob("*.csv"))]
    out = ["--out", str(tmp_path / "STUDY.yaml")]
    assert main(["init", str(tmp_path / "m.xml"), *paths, *out]) == 0, capsys.readouterr().err

    text = (tmp_path / "STUDY.yaml").read_text()
    assert "  shoulder_pan: {column: action.shoulder_pan.pos, " in text
    assert "column: observation.state.shoulder_pan.pos" in text
