"""Demonstrations as a LeRobot data set, version 3.0: Parquet and video, a row for each frame.

A row is a frame of the camera with what the robot read then, and the command at the end of the
camera's period: a controller that goes straight from the command of one row to that of the next
follows what was done. All commands between are in the Minari data set.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from jmm_agent.types import Floats, Ints
from kengoro.demonstrations.episode import Episode, frame_stride
from kengoro.demonstrations.frames import RATE
from kengoro.demonstrations.robot_file import RobotEpisodes, described_departures
from kengoro_env.robot.control_period import CONTROL_PERIOD
from kengoro_env.vision.rendering import HEIGHT, WIDTH
from mjcf_sandbox.files import whole_file, write_json

VERSION = "v3.0"
TASK = "Take the can from the table and lift it."
VIDEO = "observation.images.head"
FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
CHUNK = 1000
"""Most files of a folder."""
POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
INDICES = ("frame_index", "episode_index", "index", "task_index")

Table = dict[str, NDArray[Any]]


def file_of(position: int) -> dict[str, int]:
    """Indices of the files of a robot, by its position among the robots."""
    return {"chunk_index": position // CHUNK, "file_index": position % CHUNK}


def video_path(folder: Path, position: int) -> Path:
    """Path of the video of a robot in a data set."""
    return folder / "videos" / VIDEO / f"{FILE.format(**file_of(position))}.mp4"


def write_lerobot(folder: Path, muscles: Sequence[str], robots: Sequence[RobotEpisodes]) -> None:
    """Write all but the videos, which are there; ``meta/info.json`` comes last.

    Args:
        folder: of the data set.
        muscles: their names.
        robots: what they did, in the order of the videos.
    """
    features = feature_table(muscles)
    rows: list[dict[str, Any]] = []
    whole: list[Table] = []
    histogram = np.zeros((3, 256), dtype=np.int64)
    start = 0
    for position, robot in enumerate(robots):
        tables, video_start = [], 0
        for episode, pixels in zip(robot.episodes, robot.histograms, strict=True):
            table = episode_table(episode, len(rows), start)
            count = len(table["index"])
            rows.append(
                _episode_row(robot, position, len(rows), (start, video_start, count))
                | {"success": episode.lifted}
                | _flat(_statistics(table, pixels))
            )
            tables.append(table)
            histogram += pixels
            start, video_start = start + count, video_start + count
        path = folder / "data" / f"{FILE.format(**file_of(position))}.parquet"
        write_parquet(path, _arrow_table(_joined(tables), features))
        whole += tables
    episodes = folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    write_parquet(episodes, pa.Table.from_pylist(rows))
    write_parquet(folder / "meta" / "tasks.parquet", _task_table())
    write_json(folder / "meta" / "stats.json", _statistics(_joined(whole), histogram))
    departures = {str(robot.robot): described_departures(robot.robot) for robot in robots}
    write_json(folder / "meta" / "robots.json", departures)
    write_json(folder / "meta" / "info.json", _info(features, len(rows), start))


def feature_table(muscles: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Features of the data set, as in ``info.json``."""

    def numbers(names: Sequence[str] | None, kind: str = "float32") -> dict[str, Any]:
        count = 1 if names is None else len(names)
        return {"dtype": kind, "shape": [count], "names": None if names is None else list(names)}

    state = [f"{kind}.{name}" for kind in ("length", "tension") for name in muscles]
    video = {
        "video.height": HEIGHT, "video.width": WIDTH, "video.codec": "h264",
        "video.pix_fmt": "yuv420p", "video.is_depth_map": False, "video.fps": RATE,
        "video.channels": 3, "has_audio": False,
    }  # fmt: skip
    return {
        "observation.state": numbers(state),
        "observation.environment_state": numbers([f"can.{name}" for name in POSE]),
        "observation.frame_time": numbers(None),
        VIDEO: {
            "dtype": "video", "shape": [HEIGHT, WIDTH, 3], "names": ["height", "width", "channels"],
            "info": video,
        },
        "action": numbers([*muscles, "fingers"]),
        "next.reward": numbers(None),
        "next.done": numbers(None, "bool"),
        "next.success": numbers(None, "bool"),
        "timestamp": numbers(None),
        **{name: numbers(None, "int64") for name in INDICES},
    }  # fmt: skip


def episode_table(episode: Episode, number: int, start: int) -> Table:
    """Rows of an episode, one for each frame of the camera.

    Args:
        episode: with T control steps.
        number: index of the episode in the data set.
        start: index of its first row in the data set.
    """
    first = np.arange(0, len(episode), frame_stride(CONTROL_PERIOD))
    after = np.append(first[1:], len(episode))
    sums = np.add.reduceat(episode.rewards, first)
    rows = np.arange(len(first))
    done = np.zeros(len(first), dtype=bool)
    done[-1] = True
    return {
        "observation.state": _single(np.hstack([episode.lengths, episode.tensions])[first]),
        "observation.environment_state": _single(_poses(episode.can_pose[first])),
        "observation.frame_time": _single(episode.frame_time[first, 0]),
        "action": _single(episode.actions[after - 1]),
        "next.reward": _single(sums / (after - first)),
        "next.done": done,
        "next.success": (episode.success & episode.grasped)[after],
        "timestamp": _single(rows / RATE),
        "frame_index": rows,
        "episode_index": np.full(len(rows), number),
        "index": start + rows,
        "task_index": np.zeros(len(rows), dtype=np.int64),
    }


def _single(values: Floats) -> NDArray[np.float32]:
    return np.asarray(values, dtype=np.float32)


def _poses(poses: Floats) -> Floats:
    """Positions [m] and quaternions, scalar last, of poses (K, 4, 4); shape (K, 7)."""
    rotations = Rotation.from_matrix(poses[:, :3, :3]).as_quat(canonical=True)
    return np.hstack([poses[:, :3, 3], rotations])


def _joined(tables: Sequence[Table]) -> Table:
    return {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}


def _arrow_table(table: Table, features: Mapping[str, Any]) -> pa.Table:
    columns = {}
    for name, values in table.items():
        kind = pa.from_numpy_dtype(features[name]["dtype"])
        if values.ndim == 2:
            flat = pa.array(values.ravel(), kind)
            columns[name] = pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
        else:
            columns[name] = pa.array(values, kind)
    return pa.table(columns)


def _episode_row(
    robot: RobotEpisodes, position: int, number: int, rows: tuple[int, int, int]
) -> dict[str, Any]:
    """Entry of an episode; ``rows``: its first one in the data set, in the video, their number."""
    start, video_start, count = rows
    files = file_of(position)
    return {
        "episode_index": number,
        "tasks": [TASK],
        "length": count,
        "robot": robot.robot,
        **{f"data/{name}": index for name, index in files.items()},
        "dataset_from_index": start,
        "dataset_to_index": start + count,
        **{f"videos/{VIDEO}/{name}": index for name, index in files.items()},
        f"videos/{VIDEO}/from_timestamp": video_start / RATE,
        f"videos/{VIDEO}/to_timestamp": (video_start + count) / RATE,
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
    }


def _statistics(table: Table, pixels: Ints) -> dict[str, dict[str, Any]]:
    """Extrema, mean, deviation, number and quantiles of each feature; of pixels, by channel."""
    found = {}
    for name, values in table.items():
        numbers = values.astype(float).reshape(len(values), -1)
        found[name] = {
            "min": numbers.min(axis=0), "max": numbers.max(axis=0), "mean": numbers.mean(axis=0),
            "std": numbers.std(axis=0), "count": np.array([len(numbers)]),
            **{key: np.quantile(numbers, share, axis=0) for key, share in QUANTILES.items()},
        }  # fmt: skip
    found[VIDEO] = {
        **{key: values[:, None, None] for key, values in _pixel_statistics(pixels).items()},
        "count": np.array([len(table["index"])]),
    }
    return {
        name: {key: values.tolist() for key, values in own.items()} for name, own in found.items()
    }


def _pixel_statistics(pixels: Ints) -> dict[str, Floats]:
    """Statistics by channel, shape (3,) each, of values in [0, 1] from a histogram (3, 256)."""
    values = np.arange(256) / 255.0
    shares = np.cumsum(pixels, axis=1) / pixels.sum(axis=1, keepdims=True)
    mean = pixels @ values / pixels.sum(axis=1)
    square = pixels @ values**2 / pixels.sum(axis=1)

    def quantile(share: float) -> Floats:
        return values[(shares < share).sum(axis=1)]

    return {
        "min": values[(pixels > 0).argmax(axis=1)],
        "max": values[255 - (pixels[:, ::-1] > 0).argmax(axis=1)],
        "mean": mean,
        "std": np.sqrt(np.maximum(square - mean**2, 0.0)),
        **{key: quantile(share) for key, share in QUANTILES.items()},
    }


def _flat(statistics: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    return {
        f"stats/{name}/{key}": values
        for name, own in statistics.items()
        for key, values in own.items()
    }


def _task_table() -> pa.Table:
    """The only task; readers expect its text as the index of a table of pandas."""
    index = "__index_level_0__"
    column = {"metadata": None, "numpy_type": "int64", "pandas_type": "int64"}
    text = {**column, "numpy_type": "object", "pandas_type": "unicode"}
    described = {
        "index_columns": [index],
        "column_indexes": [],
        "columns": [
            {**column, "name": "task_index", "field_name": "task_index"},
            {**text, "name": None, "field_name": index},
        ],
        "pandas_version": "2.0.0",
    }
    table = pa.table({"task_index": pa.array([0], pa.int64()), index: pa.array([TASK])})
    return table.replace_schema_metadata({"pandas": json.dumps(described)})


def _info(features: Mapping[str, Any], episodes: int, frames: int) -> dict[str, Any]:
    return {
        "codebase_version": VERSION,
        "robot_type": "kengoro",
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": 1,
        "chunks_size": CHUNK,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": RATE,
        "splits": {"train": f"0:{episodes}"},
        "data_path": f"data/{FILE}.parquet",
        "video_path": f"videos/{{video_key}}/{FILE}.mp4",
        "features": features,
    }


def write_parquet(path: Path, table: pa.Table) -> None:
    """Write a table, whole or not at all; makes its folder."""
    with whole_file(path) as beside:
        parquet.write_table(table, beside)
