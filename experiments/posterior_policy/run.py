"""A diagnosis as a prior for training: PPO on Posture, judged on the robot that was diagnosed.

Each robot moves for a minute and is diagnosed. Policies are trained on the drawing, on guessed
randomisation, on the extended model, on samples of the posterior, and on the robot itself.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from experiments.gap_to_skill.run import QUICK as QUICK_LOG
from experiments.harness.common import (
    Summary,
    check_jobs,
    files_digest,
    make_summary,
    parse_seeds,
    source_digest,
)
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import print_results, write_files
from experiments.harness.report import metric_table
from experiments.harness.reported import log_reported
from experiments.harness.runner import run_tasks
from experiments.learn_posture.run import versions
from experiments.posterior_policy.diagnoses import diagnose_to, is_written
from experiments.posterior_policy.models import CONDITIONS, DIAGNOSED, GUESSED, TRUE
from experiments.posterior_policy.tables import metrics, policy_table
from experiments.posterior_policy.training import (
    Learn,
    Sizes,
    Training,
    judged,
    learn_by_ppo,
    train,
)

NAME = "posterior-policy"
TITLE = "The diagnosis as a prior for training"
INTRODUCTION = (
    "From one minute of a robot's motion, policies from target joint angles to lengths are trained "
    "by PPO on the drawing, on guessed randomisation of +-20 %, on the extended model, on samples "
    "of the posterior, and on the robot itself. All are judged on the robot."
)
QUICK = Sizes(512, 4, 1, 50, ("joint_offset",), QUICK_LOG)


@dataclass(frozen=True)
class Args:
    """Policies trained on what a diagnosis leaves open, judged on the robot.

    Attributes:
        robots: actual robots, as A-B or A; those below 100 are for tuning.
        seeds: of the training, as A-B or A.
        steps: number of training steps of the environments of each policy, 20 ms each.
        out: folder of the results; what is finished does not run again.
        jobs: number of parallel processes; the results do not depend on it.
        quick: run a small version that checks the installation; its numbers mean nothing.
    """

    robots: str = "0-9"
    seeds: str = "0-2"
    steps: int = 300_000
    out: Path = Path("out") / NAME
    jobs: int = 1
    quick: bool = False


class Work(NamedTuple):
    """What takes long: diagnosis of a robot into a folder, and training of a policy."""

    diagnose: Callable[[int, Sizes, Path], dict[str, Any]] = diagnose_to
    learn: Learn = learn_by_ppo


def main(args: Args) -> Summary:
    """Run what is missing; writes summary.json, report.html and the figure.

    Raises:
        ExperimentError: Stable-Baselines3 is not installed, or an option is invalid.
    """
    robots, seeds = parse_seeds(args.robots), parse_seeds(args.seeds)
    check_jobs(args.jobs)
    if args.steps < 1:
        raise ExperimentError(f"Steps are {args.steps}, but at least 1 is needed.")
    learned_with = versions()
    log_reported(NAME, robots)
    sizes = QUICK if args.quick else replace(Sizes(), steps=args.steps)
    return run(args, robots, seeds, sizes, learned_with, Work())


def run(
    args: Args,
    robots: Sequence[int],
    seeds: Sequence[int],
    sizes: Sizes,
    learned_with: str,
    work: Work,
) -> Summary:
    """Diagnose, train, judge and conclude; ``learned_with`` names the learning libraries."""
    begin = time.perf_counter()
    folders = ("posterior_policy", "gap_to_skill", "posture_accuracy", "learn_posture")
    source = source_digest(*(f"experiments/{folder}" for folder in folders), "reality_gap")
    key = f"{source} {learned_with} {asdict(sizes)}"
    diagnosed, summaries = diagnoses(args, robots, sizes, source, work)
    trained = policies(args, seeds, diagnosed, sizes, key, work)
    found = judge_all(args, robots, seeds, trained, sizes, key)
    return conclude(args, sizes, learned_with, found, trained, summaries, begin)


def diagnoses(
    args: Args, robots: Sequence[int], sizes: Sizes, source: str, work: Work
) -> tuple[dict[int, Path], dict[str, Any]]:
    """Folder of the diagnosis of each robot, and their summaries."""
    key = f"{source} {asdict(sizes.log)} {sizes.causes}"
    base = args.out / "diagnoses"
    known = files_digest([], key)[:8]
    folders = {robot: base / f"robot-{robot:03d}-{known}" for robot in robots}
    for robot, folder in folders.items():
        if not is_written(folder):
            (base / f"{robot:03d}.json").unlink(missing_ok=True)
    tasks = {f"{robot:03d}": (robot, sizes, folder) for robot, folder in folders.items()}
    return folders, run_tasks(work.diagnose, tasks, args.jobs, base, key)


def policies(
    args: Args,
    seeds: Sequence[int],
    folders: Mapping[int, Path],
    sizes: Sizes,
    key: str,
    work: Work,
) -> dict[tuple[str, int, int], dict[str, Any]]:
    """Results of `train` by condition, robot and seed; some conditions are one for all robots."""
    tasks: dict[str, tuple[Any, ...]] = {}
    names = {}
    digests = {
        robot: files_digest(sorted([*folder.glob("*.xml"), *folder.glob("posterior.json")]))[:8]
        for robot, folder in folders.items()
    }
    for condition in CONDITIONS:
        for robot, folder in folders.items():
            for seed in seeds:
                own = robot if condition in (*DIAGNOSED, TRUE) else None
                diagnosed = condition in DIAGNOSED
                name = f"{condition}-{'all' if own is None else f'{own:03d}'}-{seed:03d}"
                name += f"-{digests[robot]}" if diagnosed else ""
                training = Training(condition, own, seed, folder if diagnosed else None)
                tasks[name] = (training, sizes, work.learn)
                names[condition, robot, seed] = name
    results = run_tasks(train, tasks, args.jobs, args.out / "policies", key)
    return {which: results[name] for which, name in names.items()}


def judge_all(
    args: Args,
    robots: Sequence[int],
    seeds: Sequence[int],
    trained: Mapping[tuple[str, int, int], dict[str, Any]],
    sizes: Sizes,
    key: str,
) -> dict[str, dict[int, list[dict[str, float]]]]:
    """Numbers of each policy on its robot, by condition, robot and seed.

    Where no model fits, the guessed randomisation is judged in its place, as the message of a
    diagnosis without samples advises.
    """
    tasks: dict[str, tuple[Any, ...]] = {}
    names = {}
    for (condition, robot, seed), result in trained.items():
        policy = result["policy"] or trained[GUESSED, robot, seed]["policy"]
        digest = files_digest([], json.dumps(policy))[:8]
        name = f"{condition}-{robot:03d}-{seed:03d}-{digest}"
        names[condition, robot, seed] = name
        tasks[name] = (f"{condition}, seed {seed}, on robot {robot}", policy, robot, sizes)
    results = run_tasks(judged, tasks, args.jobs, args.out / "judged", key)
    return {
        condition: {
            robot: [results[names[condition, robot, seed]] for seed in seeds] for robot in robots
        }
        for condition in CONDITIONS
    }


def conclude(
    args: Args,
    sizes: Sizes,
    learned_with: str,
    found: dict[str, dict[int, list[dict[str, float]]]],
    trained: Mapping[tuple[str, int, int], dict[str, Any]],
    summaries: Mapping[str, Any],
    begin: float,
) -> Summary:
    """Write summary, report and figure; the run began at ``begin`` [s]."""
    from experiments.posterior_policy.figures import reward_figure  # imports matplotlib

    robots = list(found[TRUE])
    messages = notes(trained)
    table, picture = policy_table(found), reward_figure(found, robots)
    per_seed = {robot: {name: own[robot] for name, own in found.items()} for robot in robots}
    summary = make_summary(
        NAME, per_seed, time.perf_counter() - begin, title=TITLE, training_seeds=args.seeds,
        sizes=asdict(sizes), versions=learned_with, metrics=metrics(found),
        diagnoses=dict(summaries), messages=messages, tables=[table.plain()],
    )  # fmt: skip
    tables = [metric_table(summary["metrics"]), table]
    write_files(args.out, TITLE, INTRODUCTION, summary, tables, [picture])
    print_results(args.out, tables, messages)
    return summary


def notes(trained: Mapping[tuple[str, int, int], dict[str, Any]]) -> list[str]:
    """What was refused or is not simulated, a sentence for each policy and reason."""
    messages = []
    for (condition, robot, seed), result in trained.items():
        name = f"Robot {robot}, {condition}, seed {seed}"
        messages += [f"{name}: {reason}" for reason in result["refused"]]
        if result["policy"] is None:
            messages.append(f"{name}: no model fits; the guessed randomisation is judged instead")
        if result["beside"]:
            messages.append(f"{name}: beside its MJCF are {', '.join(result['beside'])}")
    return messages
