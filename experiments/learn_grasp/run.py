"""A policy that grasps on the drawing, from demonstrations or from the reward alone.

One policy for each seed of the training. The judged positions of the can are new. The last policy
is also judged on other robots, without any more learning, at the positions of `clone-grasp`.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from experiments.cloning.can_camera import CanSource
from experiments.harness.common import (
    Summary,
    check_jobs,
    make_summary,
    parse_seeds,
    source_digest,
)
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import print_results, write_files
from experiments.harness.reported import log_reported
from experiments.learn_grasp import demonstrations, reward
from experiments.learn_grasp.episodes import Run
from experiments.learn_grasp.tables import MUST, UNITS, camera_table, metrics_of, result_table
from experiments.learn_posture.run import versions

NAME = "learn-grasp"
TITLE = "Learning to grasp"
INTRODUCTION = (
    "A policy lifts a can on the drawing, from lengths, tensions, the time and the can's position, "
    "the true one or the one that the camera measures at the start. It is cloned from grasps of "
    "the learning agent, or trained by PPO from the reward, on the drawing or on guesses within "
    "20 % of it. A lifted can is one that the hand held for 1 s at 30 mm above its start. Judged "
    "positions of the can are new."
)


@dataclass(frozen=True)
class Args:
    """A policy that grasps on the drawing, with one policy for each seed.

    Attributes:
        by: what is learned from: demonstrations of the agent, or the reward alone by PPO of
            Stable-Baselines3, which the extra [rl] installs.
        can: where the can's position comes from: the true state, or the camera, which measures it
            in the frame of the start; by demonstrations only.
        models: what is trained on by reward: the drawing, or guesses within 20 % of it.
        seeds: of the training, as A-B or A; seeds below 100 are for tuning.
        robots: robots on which the policies are judged, too, as A-B or A; likewise.
        rows: amount of training from the reward, in rows of 0.2 s.
        out: folder of the results; what is finished does not run again.
        jobs: number of parallel processes; the results do not depend on it.
        cache: folder of trained maps; by default the user's cache folder.
        quick: run a small version that checks the installation; its numbers mean nothing.
    """

    by: Literal["demonstrations", "reward"] = "demonstrations"
    can: CanSource = "state"
    models: reward.Models = "drawing"
    seeds: str = "0-4"
    robots: str = "20-29"
    rows: int = 100_000
    out: Path = Path("out") / NAME
    jobs: int = 1
    cache: Path | None = None
    quick: bool = False


def main(args: Args) -> Summary:
    """Train and judge what is missing; writes summary.json, report.html and the figure.

    Raises:
        ExperimentError: an option is invalid, a training failed, or Stable-Baselines3 is needed and
            not installed.
    """
    begin = time.perf_counter()
    check_jobs(args.jobs)
    seeds, robots = parse_seeds(args.seeds), parse_seeds(args.robots)
    check_options(args)
    learned_with = versions() if args.by == "reward" else ""
    log_reported(NAME, [*seeds, *robots])
    folders = ("learn_grasp", "cloning", "learn_posture")
    source = source_digest(*(f"experiments/{folder}" for folder in folders))
    sizes: demonstrations.Sizes | reward.Sizes
    if args.by == "demonstrations":
        sizes = demonstrations.QUICK if args.quick else demonstrations.Sizes()
    else:
        sizes = reward.QUICK if args.quick else reward.Sizes(rows=args.rows)
    run = Run(args.out, f"{source} {learned_with} {asdict(sizes)}", args.jobs, args.cache)
    if isinstance(sizes, demonstrations.Sizes):
        learned, work_s = demonstrations.learn(run, seeds, robots, sizes, args.can)
    else:
        learned, work_s = reward.learn(run, seeds, robots, sizes, args.models)
    # At least the time of all tasks, also of those that ran before.
    wall_s = max(time.perf_counter() - begin, work_s / args.jobs)
    return conclude(args, asdict(sizes), learned, work_s, wall_s)


def check_options(args: Args) -> None:
    """Raise `ExperimentError` if options are invalid, or do not fit together."""
    if args.rows < 1:
        raise ExperimentError(f"Rows are {args.rows}, but at least 1 is needed.")
    if args.by == "reward" and args.can == "camera":
        raise ExperimentError(
            "Training from the reward renders no frames, so that the can's position is that of "
            "the state: leave --can out, or give --by demonstrations."
        )
    if args.by == "demonstrations" and args.models != "drawing":
        raise ExperimentError(
            f"Demonstrations are those on the drawing: leave --models out, or give --by reward "
            f"for policies that are trained on {args.models} models."
        )


def conclude(
    args: Args,
    sizes: Mapping[str, Any],
    learned: Mapping[int, Mapping[str, Any]],
    work_s: float,
    wall_s: float,
) -> Summary:
    """Write summary, report and figure.

    Args:
        args: of the run.
        sizes: amount of work.
        learned: results by seed, see `Learned`.
        work_s: duration of all tasks [s].
        wall_s: duration of the run [s].
    """
    from experiments.learn_grasp.figures import learning_curves  # imports matplotlib

    metrics = metrics_of(learned)
    tables = [result_table(args.by, learned)]
    if args.can == "camera":
        tables.append(camera_table(next(iter(learned.values()))["cans"]))
    picture = learning_curves(UNITS[args.by], learned, MUST)
    per_seed = {
        seed: {
            "at": one["at"],
            "lifted": [float(np.mean(episodes)) for episodes in one["lifted"]],
            "robots": {robot: sum(episodes) for robot, episodes in one["robots"].items()},
        }
        for seed, one in learned.items()
    }
    summary = make_summary(
        NAME, per_seed, wall_s, title=TITLE, by=args.by, can=args.can, models=args.models,
        robots=args.robots, sizes=dict(sizes), core_s=work_s,
        core_s_per_seed=round(work_s / len(learned), 1), metrics=metrics,
        tables=[table.plain() for table in tables],
    )  # fmt: skip
    write_files(args.out, TITLE, INTRODUCTION, summary, tables, [picture])
    print_results(args.out, tables)
    return summary
