"""A policy that grasps on the drawing, from demonstrations or from the reward alone.

One policy for each seed of the training. The judged positions of the can are new. The last policy
is also judged on other robots, without any more learning, at the positions of `clone-grasp`.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from experiments.harness.common import (
    Summary,
    check_jobs,
    make_summary,
    parse_seeds,
    source_digest,
)
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import print_results, write_files
from experiments.harness.report import Table
from experiments.harness.reported import log_reported
from experiments.harness.statistics import metric
from experiments.learn_grasp import demonstrations, reward
from experiments.learn_grasp.episodes import Run
from experiments.learn_posture.run import versions

NAME = "learn-grasp"
TITLE = "Learning to grasp"
INTRODUCTION = (
    "A policy lifts a can on the drawing, from lengths, tensions, the time and the can's true "
    "position. It is cloned from grasps of the learning agent, or trained by PPO from the reward. "
    "A lifted can is one that the hand held for 1 s at 30 mm above its start. Judged positions of "
    "the can are new."
)
MUST = 0.6
"""Share of lifted cans on the drawing, which each seed must reach."""


@dataclass(frozen=True)
class Args:
    """A policy that grasps on the drawing, with one policy for each seed.

    Attributes:
        by: what is learned from: demonstrations of the agent, or the reward alone by PPO of
            Stable-Baselines3, which the extra [rl] installs.
        seeds: of the training, as A-B or A; seeds below 100 are for tuning.
        robots: robots on which the policies are judged, too, as A-B or A; likewise.
        rows: amount of training from the reward, in rows of 0.2 s.
        out: folder of the results; what is finished does not run again.
        jobs: number of parallel processes; the results do not depend on it.
        cache: folder of trained maps; by default the user's cache folder.
        quick: run a small version that checks the installation; its numbers mean nothing.
    """

    by: Literal["demonstrations", "reward"] = "demonstrations"
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
    if args.rows < 1:
        raise ExperimentError(f"Rows are {args.rows}, but at least 1 is needed.")
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
        learned, work_s = demonstrations.learn(run, seeds, robots, sizes)
    else:
        learned, work_s = reward.learn(run, seeds, robots, sizes)
    # At least the time of all tasks, also of those that ran before.
    wall_s = max(time.perf_counter() - begin, work_s / args.jobs)
    return conclude(args, asdict(sizes), learned, work_s, wall_s)


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

    last = {seed: float(np.mean(one["lifted"][-1])) for seed, one in learned.items()}
    robots = list(next(iter(learned.values()))["robots"])
    others = [
        float(np.mean([one["robots"][robot] for one in learned.values()])) for robot in robots
    ]
    metrics = {
        "lifted on the drawing": metric(last, "of episodes", MUST, good="high", by="worst"),
        "lifted on other robots": metric(others, "of episodes", good="high"),
    }
    for name, (unit, good) in EXTRA.items():
        if name in next(iter(learned.values())):
            values = {seed: float(np.mean(one[name][-1])) for seed, one in learned.items()}
            metrics[name] = metric(values, unit, good=good)
    table = result_table(args.by, learned)
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
        NAME, per_seed, wall_s, title=TITLE, by=args.by, robots=args.robots, sizes=dict(sizes),
        core_s=work_s, core_s_per_seed=round(work_s / len(learned), 1), metrics=metrics,
        tables=[table.plain()],
    )  # fmt: skip
    write_files(args.out, TITLE, INTRODUCTION, summary, [table], [picture])
    print_results(args.out, [table])
    return summary


UNITS = {"demonstrations": "demonstrations", "reward": "rows of 0.2 s"}
EXTRA: dict[str, tuple[str, Literal["low", "high"]]] = {
    "reward": ("", "high"),
    "distance": ("m", "low"),
    "grasped": ("of episodes", "high"),
}
"""Further numbers of policies that are trained from the reward."""


def result_table(by: str, learned: Mapping[int, Mapping[str, Any]]) -> Table:
    """Share of lifted cans after each amount of learning, and on other robots at the end."""
    results = list(learned.values())
    rows = [
        [f"{at}", "drawing", *_shares([np.mean(one["lifted"][i]) for one in results])]
        for i, at in enumerate(results[0]["at"])
    ]
    for robot in results[0]["robots"]:
        shares = [np.mean(one["robots"][robot]) for one in results]
        rows.append([f"{results[0]['at'][-1]}", robot, *_shares(shares)])
    head = (UNITS[by], "robot", "lifted, median over seeds", "worst seed")
    note = (
        f"{len(results)} seeds of the training, each judged in {len(results[0]['lifted'][0])} "
        "episodes on the drawing. No policy has learned on the other robots."
    )
    return Table("Lifted cans at new positions", head, rows, note)


def _shares(shares: Sequence[Any]) -> list[str]:
    return [f"{np.median(shares):.0%}", f"{min(shares):.0%}"]
