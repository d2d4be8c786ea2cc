"""Cloning of a policy from episodes, kept in a file that is written once."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from experiments.cloning.features import examples
from experiments.harness.common import ROOT
from experiments.harness.errors import ExperimentError
from jmm_agent.types import Floats
from kengoro.demonstrations.episode import Episode
from mjcf_sandbox.files import write_bytes


class Training(NamedTuple):
    """How a policy is trained.

    Attributes:
        epochs: number of passes over the examples.
        seed: of the initial weights, of the order of the examples and of the noise.
    """

    epochs: int
    seed: int = 0


class Demonstration(NamedTuple):
    """An episode to clone from.

    Attributes:
        group: number of the group that it is held out with.
        episode: what was done.
        can: horizontal position of the can that the policy is given, shape (2,) [m]; None: the true
            one.
    """

    group: int
    episode: Episode
    can: Floats | None = None


def clone_examples(found: Iterable[Demonstration], history: bool) -> dict[str, Any]:
    """Inputs, commands and groups of all rows of the episodes in which the can was lifted.

    Args:
        found: the episodes.
        history: whether inputs hold the readings of the start.

    Raises:
        ExperimentError: the can was lifted in none.
    """
    parts = [
        (*examples(episode, history, can), group) for group, episode, can in found if episode.lifted
    ]
    if not parts:
        raise ExperimentError("The can was lifted in no demonstration, so that nothing is cloned.")
    return {
        "inputs": np.concatenate([inputs for inputs, _, _ in parts]),
        "commands": np.concatenate([commands for _, commands, _ in parts]),
        "groups": np.concatenate([np.full(len(inputs), group) for inputs, _, group in parts]),
    }


def clone(path: Path, arrays: dict[str, Any], training: Training) -> Path:
    """Train a policy in a process of its own, unless the file is there for the same examples.

    Args:
        path: of the policy, an npz file; that of the examples stands beside it.
        arrays: of `clone_examples`.
        training: of the policy; where it changes, the path must.

    Returns:
        The path.

    Raises:
        ExperimentError: the training failed.
    """
    content = io.BytesIO()
    np.savez(content, **arrays)
    table = path.with_name(f"{path.stem}-examples.npz")
    if path.exists() and table.exists() and table.read_bytes() == content.getvalue():
        return path
    path.unlink(missing_ok=True)  # so that a stopped training never leaves one of other examples
    write_bytes(table, content.getvalue())
    job = {
        "examples": str(table.resolve()), "policy": str(path.resolve()), **training._asdict(),
    }  # fmt: skip
    command = [sys.executable, "-m", "experiments.cloning.training", json.dumps(job)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise ExperimentError(f"The training of the policy {path.stem!r} failed: {last}")
    return path
