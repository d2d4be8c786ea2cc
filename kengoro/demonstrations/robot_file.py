"""Episodes of one robot in a file, from which a stopped command goes on."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from jmm_agent.types import Ints
from kengoro.demonstrations.damage import damaged
from kengoro.demonstrations.episode import Episode
from kengoro_env.departures import actual
from mjcf_sandbox.files import write_bytes


@dataclass(frozen=True)
class RobotEpisodes:
    """What one robot did.

    Attributes:
        robot: seed of the actual robot.
        episodes: in order.
        histograms: of the frames of each episode, shape (3, 256) each.
    """

    robot: int
    episodes: tuple[Episode, ...]
    histograms: tuple[Ints, ...]


def write_robot(path: Path, found: RobotEpisodes) -> None:
    """Write a robot's episodes, whole or not at all."""
    arrays: dict[str, Any] = {"robot": np.array(found.robot)}
    for number, (episode, histogram) in enumerate(
        zip(found.episodes, found.histograms, strict=True)
    ):
        own = {**episode.arrays(), "histogram": histogram}
        arrays |= {f"{number}/{name}": values for name, values in own.items()}
    content = io.BytesIO()
    np.savez_compressed(content, **arrays)
    write_bytes(path, content.getvalue())


def read_robot(path: Path, robot: int, episodes: int) -> RobotEpisodes:
    """Read the episodes of a robot, and check that they are those of the plan.

    Args:
        path: the file.
        robot: seed of the actual robot.
        episodes: their number.

    Raises:
        UsageError: the file is damaged, or holds another robot or number of episodes.
    """
    try:
        found = _stored(path)
    except Exception as error:  # zip, zlib, numpy and its parser raise errors of many kinds
        raise damaged(path) from error
    if found.robot != robot:
        raise damaged(path, f"holds robot {found.robot}, not {robot}")
    if len(found.episodes) != episodes:
        wrong = f"holds another number of episodes: {len(found.episodes)}, not {episodes}"
        raise damaged(path, wrong)
    return found


def _stored(path: Path) -> RobotEpisodes:
    names = [entry.name for entry in fields(Episode)]
    with np.load(path, allow_pickle=False) as stored:
        count = sum(name.endswith("/rewards") for name in stored)
        episodes = tuple(
            Episode(**{name: stored[f"{number}/{name}"] for name in names})
            for number in range(count)
        )
        histograms = tuple(stored[f"{number}/histogram"] for number in range(count))
        robot = int(stored["robot"])
    if not all(map(_is_whole, episodes)) or any(one.shape != (3, 256) for one in histograms):
        raise ValueError("an array has a wrong shape")
    return RobotEpisodes(robot, episodes, histograms)


def _is_whole(episode: Episode) -> bool:
    """Whether all arrays of an episode have as many rows as its steps tell."""
    steps = len(episode)
    rows = {name: len(values) for name, values in episode.arrays().items()}
    commands = {rows.pop(name) for name in ("actions", "rewards", "terminations")}
    return steps > 0 and commands == {steps} and set(rows.values()) == {steps + 1}


def described_departures(robot: int) -> list[dict[str, Any]]:
    """Departures of an actual robot from the nominal model: name and parameters of each."""
    return [{"departure": type(one).__name__, **_plain(asdict(one))} for one in _of(robot)]


def _of(robot: int) -> Sequence[Any]:
    return actual(robot)


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values that JSON can hold."""
    plain: dict[str, Any] = json.loads(json.dumps(values, default=lambda value: value.tolist()))
    return plain
