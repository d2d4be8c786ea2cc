"""Episodes of one robot in a file, from which a stopped command goes on."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from jmm_agent.types import Ints
from kengoro.demonstrations.episode import Episode
from kengoro.errors import UsageError
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


def read_robot(path: Path) -> RobotEpisodes:
    """Read the episodes of a robot.

    Raises:
        UsageError: the file is damaged.
    """
    names = [entry.name for entry in fields(Episode)]
    try:
        with np.load(path, allow_pickle=False) as stored:
            count = sum(name.endswith("/rewards") for name in stored)
            episodes = tuple(
                Episode(**{name: stored[f"{number}/{name}"] for name in names})
                for number in range(count)
            )
            histograms = tuple(stored[f"{number}/histogram"] for number in range(count))
            return RobotEpisodes(int(stored["robot"]), episodes, histograms)
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise UsageError(f"{path} is damaged; remove it, and this robot runs again.") from error


def described_departures(robot: int) -> list[dict[str, Any]]:
    """Departures of an actual robot from the nominal model: name and parameters of each."""
    return [{"departure": type(one).__name__, **_plain(asdict(one))} for one in _of(robot)]


def _of(robot: int) -> Sequence[Any]:
    return actual(robot)


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values that JSON can hold."""
    plain: dict[str, Any] = json.loads(json.dumps(values, default=lambda value: value.tolist()))
    return plain
