"""Robots of other sizes and kinds: each is learned by an agent with default options."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console

from experiments.harness import common
from experiments.harness.common import Summary, make_summary, parse_seeds
from experiments.harness.errors import ExperimentError
from experiments.harness.report import Table, metric_table, print_table, write_report
from experiments.harness.reported import log_reported
from experiments.harness.runner import core_seconds, run_tasks
from experiments.harness.statistics import metric
from experiments.other_robots.machine import Departures, Machine
from experiments.other_robots.models import ROBOTS, SIDES, write_model
from experiments.other_robots.public_models import add_marker
from jmm_agent.agent import Agent
from jmm_agent.types import Floats
from kengoro.agents import make_agent, scales_of
from kengoro.robots import sample_postures, shuffled_postures
from mjcf_sandbox.files import write_json

MUST = 0.25
"""Largest share of the error before learning that remains after it [1]."""
CANDIDATES = 200
"""Number of postures among which reachable ones are chosen."""
MOVE, REST = 1.0, 1.5
"""Duration of a movement, and time at its end [s]."""

INTRODUCTION = (
    "Robots of other sizes and kinds are learned by agents whose options all derive from their "
    "models. Each machine departs from its model in proportion to its size: displaced points of "
    "the wires, offsets of the lengths, and an unknown zero posture. Error: root mean square over "
    "joints between target and true joint angles, median over test postures."
)


@dataclass(frozen=True)
class Args(common.Args):
    """Robots of other sizes and kinds are learned by agents with default options.

    Attributes:
        models: further MJCF files, such as public models; a marker and a camera are added.
    """

    seeds: str = "0-9"
    out: Path = Path("out/other-robots")
    models: tuple[Path, ...] = ()


class Sizes(NamedTuple):
    """Amount of work on a robot.

    Attributes:
        learned: number of postures to learn from.
        tested: number of postures by which it is tested before and after.
    """

    learned: int = 27
    tested: int = 8


QUICK = Sizes(learned=3, tested=2)


def main(args: Args) -> Summary:
    """Learn each robot of each seed, and write ``summary.json`` and ``report.html``."""
    begin = time.perf_counter()
    seeds, sizes = parse_seeds(args.seeds), QUICK if args.quick else Sizes()
    common.check_jobs(args.jobs)
    for path in args.models:
        if not path.is_file():
            raise ExperimentError(f"There is no model file at {path}.")
    log_reported("other-robots", seeds)
    robots = [*ROBOTS, *(str(path) for path in args.models)]
    tasks = {
        f"{seed:03d}-{Path(robot).stem}": (robot, seed, sizes, args.cache)
        for seed in seeds
        for robot in robots
    }
    key = f"{common.source_digest('experiments/other_robots')} {sizes}"
    saved = run_tasks(learn, tasks, args.jobs, args.out / "robots", key, args.cluster)
    results = {
        Path(robot).stem: {seed: saved[f"{seed:03d}-{Path(robot).stem}"] for seed in seeds}
        for robot in robots
    }
    core_s = core_seconds(args.out / "robots", tasks)
    summary, table = conclude(results, begin, core_s)
    tables = [metric_table(summary["metrics"]), table]
    write_report(
        args.out / "report.html", "Robots of other sizes", INTRODUCTION, summary, tables, ()
    )
    write_json(args.out / "summary.json", summary)
    console = Console()
    console.width = max(console.width, 110)
    for each in tables:
        print_table(console, each)
    return summary


def learn(robot: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """Errors before and after learning of one machine, and postures that are not reachable.

    Args:
        robot: one of `ROBOTS`, or the path of an MJCF file.
        seed: of the machine.
        sizes: amount of work.
        cache: folder of trained maps.
    """
    sizes = Sizes(*sizes)
    with TemporaryDirectory() as name:
        folder = Path(name)
        if robot in ROBOTS:
            scene, side = write_model(robot, folder), SIDES[robot]
        else:
            scene, side = add_marker(Path(robot), folder)
        return _learn(robot, scene, side, seed, sizes, cache)


def _learn(
    robot: str, scene: Path, side: float, seed: int, sizes: Sizes, cache: Path | None
) -> dict[str, Any]:
    scales = scales_of(scene, marker_sides={0: side})
    agent = make_agent(seed, scene=scene, marker_sides={0: side}, cache=cache, learning=False)
    candidates = _candidates(robot, scene, seed)
    holds = agent.reachable(candidates)
    postures = candidates[[hold.reachable for hold in holds]]
    refused = [hold.reason for hold in holds if not hold.reachable]
    result: dict[str, Any] = {
        "not_reachable": round(len(refused) / len(holds), 3),
        "reason": refused[0] if refused else "",
    }
    if len(postures) < 2 * sizes.tested:
        return {**result, "before_deg": None, "after_deg": None, "observations": 0}
    low, high = agent.kinematics.limits.T
    departures = Departures(scales, dict(zip(agent.map.joints, high - low, strict=True)), seed)
    tested, learned = postures[: sizes.tested], postures[sizes.tested :][: sizes.learned]
    machine = Machine(scene, departures, tested[0], seed)
    before = _error_deg(machine, agent, tested)
    agent.learning = True
    for posture in learned:
        machine.move(agent, posture, MOVE, REST)
    agent.learning = False
    after = _error_deg(machine, agent, tested)
    machine.close()
    observations = agent.vision.fired
    return {**result, "before_deg": before, "after_deg": after, "observations": observations}


def _candidates(robot: str, scene: Path, seed: int) -> Floats:
    """Postures (N, n) [rad]: those of Kengoro's arm for the same arm at another size."""
    if robot == "double-arm":
        return shuffled_postures(seed)[:CANDIDATES]
    return sample_postures(scene, CANDIDATES, seed)


def _error_deg(machine: Machine, agent: Agent, postures: Floats) -> float:
    """Median over postures of the root mean square over joints of target - true [deg]."""
    missed = [machine.move(agent, posture, MOVE, REST) - posture for posture in postures]
    return round(float(np.median(np.degrees(np.sqrt(np.mean(np.square(missed), axis=1))))), 4)


def conclude(
    results: dict[str, dict[int, dict[str, Any]]], begin: float, core_s: float
) -> tuple[Summary, Table]:
    """Summary and table of the results by robot and seed.

    Args:
        results: of `learn`, by robot and seed.
        begin: start of the run (`time.perf_counter`) [s].
        core_s: time of all tasks [s].
    """
    metrics, rows = {}, []
    for robot, by_seed in results.items():
        learned = {s: r for s, r in by_seed.items() if r["before_deg"] is not None}
        refused = float(np.mean([r["not_reachable"] for r in by_seed.values()]))
        reason = next((r["reason"] for r in by_seed.values() if r["reason"]), "")
        if not learned:
            rows.append((robot, "-", "-", "-", f"{100 * refused:.0f} %", reason))
            continue
        shares = {s: r["after_deg"] / r["before_deg"] for s, r in learned.items()}
        metrics[robot] = metric(shares, "", must=MUST)
        before, after = (
            float(np.median([r[key] for r in learned.values()]))
            for key in ("before_deg", "after_deg")
        )
        share = metrics[robot]["median"]
        rows.append(
            (robot, f"{before:.2f}", f"{after:.2f}", share, f"{100 * refused:.0f} %", reason)
        )
    head = ("robot", "before [deg]", "after [deg]", "share", "not reachable", "first reason")
    table = Table("Errors before and after learning", head, rows, INTRODUCTION)
    per_seed = {
        seed: {robot: by_seed[seed] for robot, by_seed in results.items()}
        for seed in next(iter(results.values()))
    }
    wall = time.perf_counter() - begin
    summary = make_summary(
        "other-robots",
        per_seed,
        wall,
        title="Robots of other sizes",
        figure="beyond the paper",
        core_s=core_s,
        metrics=metrics,
        table=table.plain(),
    )
    return summary, table
