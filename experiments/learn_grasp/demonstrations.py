"""Policies from demonstrations: grasps of the learning agent on the drawing are cloned."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from experiments.cloning.can_camera import CanSource
from experiments.cloning.cloning import Demonstration, Training, clone, clone_examples
from experiments.cloning.policy import ClonedPolicy, lifts
from experiments.cloning.rows import RowArm
from experiments.harness.common import files_digest
from experiments.harness.runner import Tasks, Work, core_seconds, run_tasks
from experiments.learn_grasp.episodes import ROWS, Learned, Run, demonstrated, judged
from jmm_agent.types import Floats
from kengoro.demonstrations.robot import grasps, learned_agent
from mjcf_sandbox.files import write_bytes

DRAWING = "drawing"
HISTORY = True
"""Policies are given the readings of the start, and their commands count from those."""


@dataclass(frozen=True)
class Sizes:
    """Amount of work for each seed.

    Attributes:
        counts: numbers of demonstrations, ascending, after each of which a policy is cloned.
        passes: epochs of a training, times the number of its demonstrations.
        episodes: judged episodes on the drawing.
        episodes_robot: judged episodes on each other robot, of the last policy.
    """

    counts: tuple[int, ...] = (2, 5, 10, 20)
    passes: int = 4000
    episodes: int = 25
    episodes_robot: int = 5


QUICK = Sizes((2,), 100, 2, 1)


def learn(
    run: Run, seeds: Sequence[int], robots: Sequence[int], sizes: Sizes, can: CanSource = "state"
) -> Learned:
    """Demonstrate, clone and judge; what is in the folder already does not run again.

    Args:
        run: where and how.
        seeds: of the training.
        robots: further robots on which the last policy is judged.
        sizes: amount of work.
        can: where the can's position comes from, in demonstrations and in judged episodes.
    """
    run = run._replace(key=f"{run.key} {can}")
    known = files_digest([], run.key)[:8]
    names = {f"{seed:03d}-{end:03d}": (seed, end) for seed in seeds for end in sizes.counts}
    first = dict(zip(sizes.counts, (0, *sizes.counts), strict=False))
    folder = run.out / f"demonstrations-{known}"
    files = {at: folder / f"{name}.npz" for name, at in names.items()}
    tasks: dict[str, tuple[Any, ...]] = {
        name: (files[seed, end], seed, first[end], end, run.cache, can)
        for name, (seed, end) in names.items()
    }
    work_s = _run_all(demonstrate, tasks, folder, run)
    folder = run.out / f"policies-{known}"
    policies: dict[str, tuple[Any, ...]] = {}
    for name, (seed, end) in names.items():
        own = [files[seed, count] for count in sizes.counts if count <= end]
        policies[name] = (folder / f"{name}.npz", own, ceil(sizes.passes / end), seed)
    work_s += _run_all(train, policies, folder, run)
    judgements: dict[str, tuple[Any, ...]] = {}
    for name, (path, *_) in policies.items():
        judgements[f"{name}-{DRAWING}"] = (path, None, sizes.episodes, can)
        if names[name][1] == sizes.counts[-1]:
            for robot in robots:
                judgements[f"{name}-{robot:03d}"] = (
                    path,
                    robot,
                    sizes.episodes_robot,
                    can,
                )
    folder = run.out / f"judged-{known}"
    found = run_tasks(judge, judgements, run.jobs, folder, run.key)
    return sorted_by_seed(found, seeds, sizes, can), work_s + core_seconds(folder, judgements)


def _run_all(work: Work, tasks: Tasks, folder: Path, run: Run) -> float:
    """Run tasks that write the file that is their first argument; their duration [s]."""
    for path, *_ in tasks.values():
        if not path.exists():
            path.with_suffix(".json").unlink(missing_ok=True)
    run_tasks(work, tasks, run.jobs, folder, run.key)
    return core_seconds(folder, tasks)


def sorted_by_seed(
    found: Mapping[str, Mapping[str, list[Any]]],
    seeds: Sequence[int],
    sizes: Sizes,
    can: CanSource,
) -> dict[int, dict[str, Any]]:
    """Results of each seed from those of the tasks, whose names hold seed, count and robot."""
    results: dict[int, dict[str, Any]] = {
        seed: {"at": list(sizes.counts), "lifted": [], "robots": {}} for seed in seeds
    }
    for name, judged_by in found.items():
        seed, _, robot = name.split("-")
        result, lifted = results[int(seed)], judged_by["lifted"]
        if robot == DRAWING:
            result["lifted"].append(lifted)
        else:
            result["robots"][robot] = lifted
        if can == "camera":  # all policies and seeds are judged in the same episodes
            own = {part: judged_by[part] for part in ("seen", "errors")}
            result.setdefault("cans", {})[robot] = own
    return results


def demonstrate(
    path: Path, seed: int, first: int, end: int, cache: Path | None, can: CanSource
) -> int:
    """Let the agent grasp on the drawing, and write what is cloned; the number of lifted cans.

    Args:
        path: of the examples, an npz file.
        seed: of the training.
        first: number of the first demonstration.
        end: number after that of the last one.
        cache: folder of trained maps.
        can: where the can's position comes from.
    """
    agent = learned_agent(None, cache=cache)
    seeds = [demonstrated(seed, number) for number in range(first, end)]
    episodes = list(grasps(agent, None, seeds))
    agent.close()
    cans = measured_cans(seeds) if can == "camera" else [None] * len(seeds)
    shown = map(Demonstration, range(first, end), episodes, cans)
    content = io.BytesIO()
    np.savez_compressed(content, **clone_examples(shown, HISTORY))
    write_bytes(path, content.getvalue())
    return sum(episode.lifted for episode in episodes)


def measured_cans(seeds: Iterable[int]) -> list[Floats]:
    """Position of the can by camera in each episode on the drawing, shape (2,) [m]."""
    arm = RowArm(None, "camera")
    found = []
    for seed in seeds:
        arm.reset(seed)
        found.append(arm.can)
    arm.close()
    return found


def train(path: Path, examples: Sequence[Path], epochs: int, seed: int) -> None:
    """Clone a policy from the files of examples."""
    parts = []
    for one in examples:
        with np.load(one, allow_pickle=False) as stored:
            parts.append({name: stored[name] for name in stored.files})
    arrays = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    clone(path, arrays, Training(epochs, seed))


def judge(path: Path, robot: int | None, episodes: int, can: CanSource) -> dict[str, list[Any]]:
    """Entries of `Lifts` of a policy on a robot, or on the drawing (None)."""
    found = lifts(ClonedPolicy(path, HISTORY), robot, judged(robot, episodes), ROWS, can)
    return found._asdict()
