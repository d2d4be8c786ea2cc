"""Demonstrations as a Minari data set in its Parquet format: every control step, without frames.

Minari's own package is not needed: a folder for each episode holds a Parquet file with a row for
each observation (in the last row, which has no action, actions and rewards are zero) and JSON.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pyarrow as pa
from gymnasium import spaces
from numpy.typing import NDArray

from kengoro.demonstrations.episode import STATES, TRUTHS, Episode
from kengoro.demonstrations.lerobot import write_parquet
from kengoro.demonstrations.robot import episode_seed
from kengoro.demonstrations.robot_file import RobotEpisodes, described_departures
from mjcf_sandbox.files import write_json

VERSION = "0.5.4"
"""Version of Minari whose format is written."""
NAME = "kengoro/can-grasp/learning-agent-v0"
TASK = "Kengoro/CanGrasp-v0"


def write_minari(
    root: Path, observation: spaces.Dict, action: spaces.Box, robots: Sequence[RobotEpisodes]
) -> None:
    """Write the data set; its metadata come last.

    Args:
        root: folder for ``MINARI_DATASETS_PATH``.
        observation: the environment's space, of which the entries `STATES` are written.
        action: the environment's space.
        robots: what they did.
    """
    folder = root / NAME / "data"
    number = steps = size = 0
    for robot in robots:
        described = described_departures(robot.robot)
        for own, episode in enumerate(robot.episodes):
            path = folder / str(number) / "part-0.parquet"
            write_parquet(path, episode_table(episode))
            content = {
                "id": number, "total_steps": len(episode),
                "seed": episode_seed(robot.robot, own), "robot": robot.robot,
                "success": episode.lifted, "departures": described,
            }  # fmt: skip
            write_json(path.with_name("metadata.json"), content)
            number, steps = number + 1, steps + len(episode)
            size += path.stat().st_size
    space = spaces.Dict({name: observation[name] for name in STATES})
    content = _metadata(space, action, (number, steps, size))
    departures = {str(robot.robot): described_departures(robot.robot) for robot in robots}
    write_json(folder / "metadata.json", {**content, "robots": departures})


def episode_table(episode: Episode) -> pa.Table:
    """Rows of an episode, one for each observation."""
    arrays = episode.arrays()
    ended = episode.terminations[-1]
    cut = np.zeros(len(episode), dtype=bool)
    cut[-1] = not ended
    return pa.table(
        {
            "observations": _struct({name: arrays[name] for name in STATES}),
            "actions": _lists(_padded(episode.actions)),
            "rewards": _padded(episode.rewards),
            "terminations": _padded(episode.terminations),
            "truncations": _padded(cut),
            "infos": _struct({name: arrays[name] for name in TRUTHS}, shapes=True),
        }
    )


def _padded(values: NDArray[Any]) -> NDArray[Any]:
    return np.concatenate([values, np.zeros_like(values[:1])])


def _lists(values: NDArray[Any]) -> pa.Array:
    """An array (K, ...) as K lists."""
    flat = values.reshape(len(values), -1)
    return pa.FixedSizeListArray.from_arrays(pa.array(flat.ravel()), flat.shape[1])


def _struct(entries: Mapping[str, NDArray[Any]], shapes: bool = False) -> pa.StructArray:
    """Entries by name; with ``shapes``, fields name those of arrays, as Minari's infos do."""
    arrays, fields = [], []
    for name, values in entries.items():
        array = pa.array(values) if values.ndim == 1 else _lists(values)
        shape = {"shape": ",".join(map(str, values.shape[1:]))}
        arrays.append(array)
        fields.append(
            pa.field(name, array.type, metadata=shape if shapes and values.ndim > 1 else None)
        )
    return pa.StructArray.from_arrays(arrays, fields=fields)


def _metadata(
    space: spaces.Dict, action: spaces.Box, sizes: tuple[int, int, int]
) -> dict[str, Any]:
    """Metadata of the data set; ``sizes``: number of episodes, of steps, and of bytes."""
    episodes, steps, size = sizes
    return {
        "total_episodes": episodes,
        "total_steps": steps,
        "data_format": "parquet",
        "jpeg_encoding": True,
        "observation_space": json.dumps(_described(space)),
        "action_space": json.dumps(_described(action)),
        "env_spec": gym.spec(TASK).to_json(),
        "dataset_id": NAME,
        "algorithm_name": "Kengoro's agent after learning, with learning off",
        "description": "Grasps of a can at new positions by actual robots, which differ from their "
        "drawing. Frames are in the LeRobot data set of the same command.",
        "minari_version": VERSION,
        "requirements": ["kengoro"],
        "dataset_size": round(size / 1e6, 1),
    }


def _described(space: spaces.Space[Any]) -> dict[str, Any]:
    """A space as Minari writes it."""
    if isinstance(space, spaces.Dict):
        return {
            "type": "Dict",
            "subspaces": {name: _described(own) for name, own in space.spaces.items()},
        }
    assert isinstance(space, spaces.Box)
    return {
        "type": "Box", "dtype": str(space.dtype), "shape": list(space.shape),
        "low": space.low.tolist(), "high": space.high.tolist(),
    }  # fmt: skip
