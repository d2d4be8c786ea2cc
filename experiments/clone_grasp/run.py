"""Behaviour cloning of grasps, judged on other robots beside the learning agent.

Robots learn and grasp (`kengoro dataset`). Two policies are cloned from that, one with the
readings of the start and one without. Both move robots that they were not cloned from, and the
drawing. On the same robots the learning agent learns first, and then grasps cans at the same
positions.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from experiments.cloning.cloning import Demonstration, Training, clone, clone_examples
from experiments.cloning.features import STRIDE
from experiments.cloning.policy import ClonedPolicy, lifts
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
from experiments.harness.report import Table
from experiments.harness.reported import log_reported
from experiments.harness.runner import progress_bar, run_tasks
from experiments.harness.statistics import metric
from kengoro.demonstrations.dataset import Plan, make_datasets
from kengoro.demonstrations.robot import episode_seed, grasps, learned_agent
from kengoro.demonstrations.robot_file import RobotEpisodes
from kengoro.errors import UsageError
from kengoro.hand_search import TrialOptions

NAME = "clone-grasp"
TITLE = "Behaviour cloning of grasps"
INTRODUCTION = (
    "Two policies are cloned from grasps of robots that have learned: one is given the present "
    "readings of lengths and tensions, the time and the can's position, the other those of the "
    "start, too, from which its commands count. A lifted can is one that the hand held for 1 s at "
    "30 mm above its start."
)
HISTORY = {"history": True, "present": False}
"""The cloned policies, and whether their inputs hold the readings of the start."""
NAMES = {
    "agent": "learning agent",
    "history": "cloned, with a history",
    "present": "cloned, without a history",
}
DRAWING = "drawing"
MUST_ON_DRAWING = 0.6
"""Share of lifted cans on the drawing, at new positions, by examples alone."""
ON_DRAWING = 4
"""Episodes on the drawing for one on each robot."""


@dataclass(frozen=True)
class Sizes:
    """Amount of work.

    Attributes:
        demonstrations: grasps of each robot that is cloned from.
        epochs: of each training.
        episodes: grasps of each policy on each robot that is judged, and on the drawing.
        trial: options of the trial in which a robot learns.
    """

    demonstrations: int = 10
    epochs: int = 200
    episodes: int = 5
    trial: TrialOptions = field(default_factory=TrialOptions)


QUICK = Sizes(1, 2, 1, TrialOptions(approaches=2, postures=3, move=1.0, patience=1.5))


@dataclass(frozen=True)
class Args:
    """Behaviour cloning of grasps, judged on robots that it was not cloned from.

    Attributes:
        seeds: robots that are judged, as A-B or A; seeds below 100 are for tuning.
        robots: robots that are cloned from, as A-B or A, ten grasps each.
        out: folder of the results; what is finished does not run again.
        jobs: number of parallel processes; the results do not depend on it.
        cache: folder of trained maps; by default the user's cache folder.
        quick: run a small version that checks the installation; its numbers mean nothing.
    """

    seeds: str = "20-29"
    robots: str = "0-19"
    out: Path = Path("out") / NAME
    jobs: int = 1
    cache: Path | None = None
    quick: bool = False


def main(args: Args) -> Summary:
    """Make the data set, clone, judge; writes summary.json, report.html and the figure.

    Raises:
        ExperimentError: an option is invalid, or a training failed.
    """
    begin = time.perf_counter()
    check_jobs(args.jobs)
    judged, cloned = parse_seeds(args.seeds), parse_seeds(args.robots)
    if len(cloned) < 2 or set(judged) & set(cloned):
        raise ExperimentError(
            f"Policies are cloned from the robots {args.robots} and judged on {args.seeds}; at "
            "least 2 are needed to clone from, and none may be in both."
        )
    log_reported(NAME, [*judged, *cloned])
    sizes = QUICK if args.quick else Sizes()
    source = source_digest("experiments/clone_grasp", "experiments/cloning")
    found = demonstrations(args, cloned, sizes)
    policies = {name: clone_named(args.out, found, name, sizes, source) for name in HISTORY}
    rows = max(len(one) for robot in found for one in robot.episodes) // STRIDE + 1
    results = judge(args, judged, policies, rows, sizes, source)
    lifted = [one.lifted for robot in found for one in robot.episodes]
    return conclude(args, sizes, judged, results, lifted, time.perf_counter() - begin)


def demonstrations(args: Args, robots: Sequence[int], sizes: Sizes) -> list[RobotEpisodes]:
    """Grasps to clone from, in a folder that is named by the code that they depend on.

    Raises:
        ExperimentError: a file in the folder is damaged.
    """
    plan = Plan(tuple(robots), sizes.demonstrations, sizes.trial)
    known = files_digest([], f"{source_digest()} {asdict(plan)}")  # cloning changes none of it
    folder = args.out / f"data-{known[:8]}"
    with progress_bar("demonstrations", len(robots) * sizes.demonstrations) as advance:

        def progress(text: str, by: float) -> None:
            for _ in range(int(by)):
                advance(text)

        try:
            return make_datasets(plan, folder, progress, args.jobs, args.cache)
        except UsageError as error:
            raise ExperimentError(str(error)) from error


def clone_named(
    out: Path, found: Sequence[RobotEpisodes], name: str, sizes: Sizes, source: str
) -> Path:
    """Train a policy of `HISTORY` unless that is done; the path of its file.

    Raises:
        ExperimentError: the training failed, or the can was lifted in no demonstration.
    """
    known = files_digest([], f"{source} {asdict(sizes)}")
    path = out / "policies" / f"{name}-{known[:8]}.npz"
    shown = (Demonstration(robot.robot, episode) for robot in found for episode in robot.episodes)
    arrays = clone_examples(shown, HISTORY[name])
    with Console().status(f"Cloning: {NAMES[name]} ..."):
        return clone(path, arrays, Training(sizes.epochs))


def judge(
    args: Args,
    robots: Sequence[int],
    policies: Mapping[str, Path],
    rows: int,
    sizes: Sizes,
    source: str,
) -> dict[str, dict[str, list[bool]]]:
    """Whether the can was lifted in each episode, by policy and robot."""
    agents = {f"{robot:03d}": (robot, sizes, args.cache) for robot in robots}
    key = f"{source} {asdict(sizes)}"
    found = {"agent": run_tasks(run_agent, agents, args.jobs, args.out / "agent", key)}
    for name, path in policies.items():
        tasks: dict[str, tuple[Any, ...]]
        tasks = {own: (path, name, robot, rows, sizes) for own, (robot, _, _) in agents.items()}
        tasks[DRAWING] = (path, name, None, rows, sizes)
        weights = files_digest([path], f"{key} {rows}")
        found[name] = run_tasks(run_cloned, tasks, args.jobs, args.out / name, weights)
    return found


def run_agent(robot: int, sizes: Sizes, cache: Path | None) -> list[bool]:
    """Let the agent learn on a robot, and grasp."""
    agent = learned_agent(robot, sizes.trial, cache)
    seeds = [episode_seed(robot, number) for number in range(sizes.episodes)]
    found = [bool(one.success.any()) for one in grasps(agent, robot, seeds, sizes.trial)]
    agent.close()
    return found


def run_cloned(path: Path, name: str, robot: int | None, rows: int, sizes: Sizes) -> list[bool]:
    """Let a cloned policy grasp on a robot, or on the drawing (None)."""
    policy = ClonedPolicy(path, HISTORY[name])
    count = sizes.episodes if robot is not None else ON_DRAWING * sizes.episodes
    seeds = [episode_seed(robot, number) for number in range(count)]
    return lifts(policy, robot, seeds, rows).lifted


def conclude(
    args: Args,
    sizes: Sizes,
    robots: Sequence[int],
    results: Mapping[str, Mapping[str, list[bool]]],
    demonstrated: Sequence[bool],
    wall_s: float,
) -> Summary:
    """Write summary, report and figure.

    Args:
        args: of the run.
        sizes: amount of work.
        robots: that were judged.
        results: whether the can was lifted in each episode, by policy and robot.
        demonstrated: whether it was in each demonstration.
        wall_s: duration of the run [s].
    """
    from experiments.clone_grasp.figures import success_figure  # imports matplotlib

    shares = {
        policy: [float(np.mean(own[f"{robot:03d}"])) for robot in robots]
        for policy, own in results.items()
    }
    drawing = {policy: float(np.mean(results[policy][DRAWING])) for policy in HISTORY}
    metrics = {
        f"{NAMES[policy]}, on new robots": metric(values, "of episodes", good="high")
        for policy, values in shares.items()
    }
    for policy, value in drawing.items():
        must = MUST_ON_DRAWING if policy == "history" else None
        metrics[f"{NAMES[policy]}, on the drawing"] = metric(
            [value], "of episodes", must, good="high"
        )
    table = result_table(results, robots, demonstrated)
    picture = success_figure(
        {NAMES[policy]: values for policy, values in shares.items()}, [str(r) for r in robots]
    )
    per_seed = {
        robot: {policy: own[f"{robot:03d}"] for policy, own in results.items()} for robot in robots
    }
    summary = make_summary(
        NAME, per_seed, wall_s, title=TITLE, sizes=asdict(sizes), robots=args.robots,
        demonstrations={"episodes": len(demonstrated), "lifted": sum(demonstrated)},
        drawing={policy: results[policy][DRAWING] for policy in HISTORY},
        metrics=metrics, tables=[table.plain()],
    )  # fmt: skip
    write_files(args.out, TITLE, INTRODUCTION, summary, [table], [picture])
    print_results(args.out, [table])
    return summary


def result_table(
    results: Mapping[str, Mapping[str, list[bool]]],
    robots: Sequence[int],
    demonstrated: Sequence[bool],
) -> Table:
    """Lifted cans of each policy: on all new robots, on the worst of them, and on the drawing."""
    rows = []
    for policy, own in results.items():
        lifted = [own[f"{robot:03d}"] for robot in robots]
        worst = min(float(np.mean(one)) for one in lifted)
        drawing = _count(own[DRAWING]) if DRAWING in own else "-"
        rows.append([NAMES[policy], _count(np.concatenate(lifted)), f"{worst:.0%}", drawing])
    head = ("policy", "lifted on new robots", "on the worst of them", "lifted on the drawing")
    note = (
        f"The agent has learned on each of the {len(robots)} robots; cloned policies have not. "
        f"They were cloned from other robots, which lifted {_count(demonstrated)} cans. They are "
        "given the true position of the can, which the agent sees by its camera."
    )
    return Table("Lifted cans", head, rows, note)


def _count(lifted: Sequence[bool] | np.ndarray) -> str:
    return f"{int(np.sum(lifted))} of {len(lifted)}"
