"""Reinforcement learning of postures from the reward of ``Kengoro/Posture-v0``.

One policy for each seed is trained by PPO or SAC of Stable-Baselines3 (see `policies`). It is
evaluated during training in episodes that it does not learn from, and compared with policies that
do not learn: random actions, holding still, the rest command, and the nominal lengths of the target
posture.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, replace
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
from experiments.harness.runner import core_seconds, run_tasks
from experiments.harness.statistics import metric
from experiments.learn_posture.policies import OTHERS, Sizes, judge_others, learn, libraries

NAME = "learn-posture"
TITLE = "Reinforcement learning of postures"
INTRODUCTION = (
    "A policy from target joint angles to target lengths of all muscles is learned from the reward "
    "alone. It is evaluated by its mean reward of a step, at most 1, in episodes that it does not "
    "learn from."
)

QUICK = Sizes(steps=4096, environments=16, checks=2, short=4, whole=1)
OTHERS_TASK = "others"

NAMES = {
    "learned": "learned",
    "random": "random actions",
    "still": "holds still",
    "rest": "rest command (untrained)",
    "nominal": "nominal lengths",
}


@dataclass(frozen=True)
class Args:
    """Reinforcement learning of postures, with one policy for each seed.

    Attributes:
        algorithm: of Stable-Baselines3, which the extra [rl] installs.
        steps: number of training steps of the environments, 20 ms each.
        seeds: of the training, as A-B or A; seeds below 100 are for tuning.
        robot: seed of the actual robot; the nominal model by default.
        out: folder of the results; finished policies are not trained again.
        jobs: number of parallel processes; the results do not depend on it.
        quick: run a small version that checks the installation; its numbers mean nothing.
    """

    algorithm: Literal["ppo", "sac"] = "ppo"
    steps: int = 300_000
    seeds: str = "0-2"
    robot: int | None = None
    out: Path = Path("out/learn-posture")
    jobs: int = 1
    quick: bool = False


def main(args: Args) -> Summary:
    """Train the missing policies and write summary.json, report.html and the figure.

    Raises:
        ExperimentError: Stable-Baselines3 is not installed, or an option is invalid.
    """
    begin = time.perf_counter()
    seeds = parse_seeds(args.seeds)
    check_jobs(args.jobs)
    if args.steps < 1:
        raise ExperimentError(f"Steps are {args.steps}, but at least 1 is needed.")
    learned_with = versions()
    log_reported("learn-posture", seeds)
    sizes = replace(QUICK if args.quick else Sizes(steps=args.steps), robot=args.robot)
    tasks: dict[str, tuple[Any, ...]] = {OTHERS_TASK: (OTHERS_TASK, 0, sizes)}
    tasks |= {f"{args.algorithm}-{seed:03d}": (args.algorithm, seed, sizes) for seed in seeds}
    key = f"{source_digest('experiments/learn_posture')} {learned_with} {asdict(sizes)}"
    results = run_tasks(run, tasks, args.jobs, args.out / "policies", key)
    others = results.pop(OTHERS_TASK)
    learned = dict(zip(seeds, results.values(), strict=True))
    work_s = core_seconds(args.out / "policies", tasks)
    # At least the time of all tasks, also of those that ran before.
    wall_s = max(time.perf_counter() - begin, work_s / args.jobs)
    return conclude(args, sizes, learned_with, learned, others, wall_s)


def versions() -> str:
    """Versions of the learning libraries; raises `ExperimentError` if they are not installed."""
    libraries()
    import stable_baselines3
    import torch

    return f"stable-baselines3 {stable_baselines3.__version__}, torch {torch.__version__}"


def run(what: str, seed: int, sizes: Sizes) -> dict[str, Any]:
    """One task: train a policy by the algorithm ``what``, or score those that do not learn."""
    return judge_others(sizes.robot, sizes) if what == OTHERS_TASK else learn(what, seed, sizes)


def conclude(
    args: Args,
    sizes: Sizes,
    learned_with: str,
    learned: dict[int, dict[str, Any]],
    others: dict[str, Any],
    wall_s: float,
) -> Summary:
    """Write summary, report and figure of the policies by seed and of the others.

    ``learned_with`` names the versions of the learning libraries; the run took ``wall_s`` [s].
    """
    from experiments.learn_posture.figures import learning_curve  # imports matplotlib

    rewards = {seed: float(np.mean(one["whole"]["reward"])) for seed, one in learned.items()}
    successes = {seed: float(np.mean(one["whole"]["success"])) for seed, one in learned.items()}
    metrics = {
        "reward of a step": metric(rewards, "", good="high"),
        "share of steps with success": metric(successes, "", good="high"),
    }
    for name in OTHERS:
        over = {
            seed: reward - float(np.mean(others[name]["whole"]["reward"]))
            for seed, reward in rewards.items()
        }
        metrics[f"reward above: {NAMES[name]}"] = metric(over, "", good="high")
    table = policy_table(learned, others)
    picture = learning_curve(args.algorithm.upper(), learned, others)
    summary = make_summary(
        NAME,
        {seed: {"reward": rewards[seed], "success": successes[seed]} for seed in learned},
        wall_s,
        title=TITLE,
        algorithm=args.algorithm,
        versions=learned_with,
        sizes=asdict(sizes),
        metrics=metrics,
        tables=[table.plain()],
        curves={str(seed): curve(one) for seed, one in learned.items()},
    )
    write_files(args.out, TITLE, INTRODUCTION, summary, [table], [picture])
    print_results(args.out, [table])
    return summary


def curve(learned: dict[str, Any]) -> dict[str, list[float]]:
    """Steps of training, and mean reward of a step in short episodes after them."""
    means = [round(float(np.mean(rewards)), 4) for rewards in learned["short"]]
    return {"steps": learned["steps"], "reward": means}


def policy_table(learned: dict[int, dict[str, Any]], others: dict[str, Any]) -> Table:
    """Table of reward and success of all policies in whole episodes."""

    def row(name: str, rewards: list[float], successes: list[float], policies: int) -> list[str]:
        middle, low, high = np.median(rewards), min(rewards), max(rewards)
        figures = f"{middle:.3f} ({low:.3f} to {high:.3f})"
        return [NAMES[name], f"{policies}", figures, f"{100 * np.median(successes):.0f}"]

    whole = [one["whole"] for one in learned.values()]
    rewards, successes = (
        [float(np.mean(one[key])) for one in whole] for key in ("reward", "success")
    )
    rows = [row("learned", rewards, successes, len(learned))]
    rows += [
        row(name, others[name]["whole"]["reward"], others[name]["whole"]["success"], 1)
        for name in OTHERS
    ]
    return Table(
        "Reward in whole episodes",
        ("policy", "policies", "reward of a step", "steps with success [%]"),
        rows,
        "Median and range: of the learned policies over their mean in all episodes, of the others "
        "over episodes. Success is an RMS error over all joints below 5 deg.",
    )
