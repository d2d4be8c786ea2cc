"""Commissioning runs of robots with one fault: how often it is named, and what the run costs."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from rich.console import Console

from experiments.commissioning.robots import (
    FAULTS,
    ROBOTS,
    Fault,
    FaultyRobot,
    departures_of,
    map_and_motors,
    sample_fault,
    scene_of,
    start_of,
)
from experiments.harness import common
from experiments.harness.common import Summary, make_summary, parse_seeds
from experiments.harness.errors import ExperimentError
from experiments.harness.report import Table, metric_table, print_table, write_report
from experiments.harness.reported import log_reported
from experiments.harness.runner import core_seconds, run_tasks
from experiments.harness.statistics import metric
from jmm_agent.commissioning.commissioning import Commissioner, Commissioning
from mjcf_sandbox.files import write_json

POSTURE = 0.1
"""Standard deviation of the posture that is given from the true one, as a share of the ranges of
the joints [1]."""

COUNTED = ("right", "muscles_right", "false", "undecided", "silent")
"""What is counted of the scores."""

INTRODUCTION = (
    "Each robot has one fault of random muscles, or none. Its posture is known to a tenth of the "
    "joints' ranges. A fault is named right if its kind and all its muscles are named and nothing "
    "else. What is reported as undecided counts as neither right nor false."
)


@dataclass(frozen=True)
class Args(common.Args):
    """Commissioning runs of robots with and without faults.

    Attributes:
        robots: names of the robots, separated by commas.
        faults: names of the faults, separated by commas.
        held: whether the run knows what the motors hold at its start.
    """

    seeds: str = "0-9"
    out: Path = Path("out/commissioning")
    robots: str = ",".join(ROBOTS)
    faults: str = ",".join(FAULTS)
    held: bool = False


def main(args: Args) -> Summary:
    """Run all robots with all faults, and write ``summary.json`` and ``report.html``."""
    begin, seeds = time.perf_counter(), parse_seeds(args.seeds)
    common.check_jobs(args.jobs)
    robots, faults = _named(args.robots, ROBOTS), _named(args.faults, FAULTS)
    if args.quick:
        robots, faults, seeds = ["elbow"], ["none", "swapped"], seeds[:1]
    log_reported("commissioning", seeds)
    tasks = {
        f"{seed:03d}-{robot}-{fault}": (robot, fault, seed, args.held, args.cache)
        for seed in seeds
        for robot in robots
        for fault in faults
    }
    digest = common.source_digest("experiments/commissioning", "experiments/other_robots")
    key = f"{digest} held={args.held}"
    saved = run_tasks(trial, tasks, args.jobs, args.out / "robots", key, args.cluster)
    summary, table = conclude(
        {(robot, fault): {seed: saved[f"{seed:03d}-{robot}-{fault}"] for seed in seeds}
         for robot in robots for fault in faults},
        seeds, begin, core_seconds(args.out / "robots", tasks),
    )  # fmt: skip
    tables = [metric_table(summary["metrics"]), table]
    write_report(args.out / "report.html", "Commissioning runs", INTRODUCTION, summary, tables, ())
    write_json(args.out / "summary.json", summary)
    console = Console()
    console.width = max(console.width, 110)
    for each in tables:
        print_table(console, each)
    return summary


def _named(text: str, known: tuple[str, ...]) -> list[str]:
    """Names in a list; an error for an unknown one."""
    names = text.split(",")
    for name in names:
        if name not in known:
            raise ExperimentError(f"There is no {name!r}; there are: {', '.join(known)}.")
    return names


def trial(robot: str, fault: str, seed: int, held: bool, cache: Path | None) -> dict[str, Any]:
    """One commissioning run.

    Args:
        robot: one of `ROBOTS`.
        fault: one of `FAULTS`.
        seed: of robot and fault.
        held: whether the run knows what the motors hold at its start.
        cache: folder of trained maps.
    """
    with TemporaryDirectory() as name:
        scene = scene_of(robot, Path(name))
        jmm, limits, motors, travel = map_and_motors(scene, cache)
        rng = np.random.default_rng([seed, FAULTS.index(fault), 36])
        what = sample_fault(fault, len(jmm.muscles), rng)
        departures, start = departures_of(robot, scene, seed), start_of(robot, scene, seed)
        machine = FaultyRobot(scene, departures, what, start, seed, travel)
    low, high = limits.T
    given = start + POSTURE * (high - low) * rng.standard_normal(len(start))
    commissioner = Commissioner(jmm, limits, given, motors, held=machine.held if held else None)
    while not commissioner.done:
        readings = machine.read()
        if readings.time == 0.0 and commissioner.refuse(readings):
            break
        machine.write(commissioner.step(readings))
    result = commissioner.result()
    return {
        **score(result, what),
        "seconds": round(result.seconds, 1),
        "tension": round(machine.pulled / motors.limit, 3),
        "moved_deg": round(float(np.degrees(machine.moved)), 1),
        "found": [[each.kind, *each.muscles] for each in result.findings],
        "fault": [what.kind, *(jmm.muscles[channel] for channel in what.channels), what.factor],
    }


def score(result: Commissioning, fault: Fault) -> dict[str, bool]:
    """Whether a fault was named right, only by its muscles, or not; and whether names are false.

    Args:
        result: of the run.
        fault: that the robot has.
    """
    muscles = {result.muscles[channel] for channel in fault.channels}
    found = [(each.kind, set(each.muscles)) for each in result.findings]
    right = found == ([(fault.kind, muscles)] if fault.kind else [])
    undecided = any(muscles & set(each.muscles) for each in result.undecided)
    return {
        "right": right,
        "muscles_right": bool(muscles) and {m for _, own in found for m in own} == muscles,
        "false": any(not own <= muscles for _, own in found),
        "undecided": not found and bool(muscles) and undecided,
        "silent": not found and bool(muscles) and not undecided,
    }


def conclude(
    results: dict[tuple[str, str], dict[int, dict[str, Any]]],
    seeds: list[int],
    begin: float,
    core_s: float,
) -> tuple[Summary, Table]:
    """Summary and table of the results by robot and fault.

    Args:
        results: of `trial`, by robot and fault, and by seed.
        seeds: of the robots.
        begin: start of the run (`time.perf_counter`) [s].
        core_s: time of all tasks [s].
    """
    rows = []
    for (robot, fault), by_seed in results.items():
        runs = list(by_seed.values())
        counts = [sum(run[key] for run in runs) for key in COUNTED]
        worst = [max(run[key] for run in runs) for key in ("seconds", "tension", "moved_deg")]
        rows.append((robot, fault, len(runs), *counts, *worst))
    head = ("robot", "fault", "runs", "right", "muscles right", "false names", "undecided",
            "silent", "longest [s]", "tension / limit", "moved [deg]")  # fmt: skip
    table = Table("Faults of robots, and what was named", head, rows, INTRODUCTION)
    metrics = {}
    for robot in dict.fromkeys(robot for robot, _ in results):
        own = [by_seed for (each, _), by_seed in results.items() if each == robot]
        shares = {seed: float(np.mean([runs[seed]["right"] for runs in own])) for seed in seeds}
        metrics[f"named right, {robot}"] = metric(shares, "")
    summary = make_summary(
        "commissioning",
        {
            seed: {f"{robot} {fault}": runs[seed] for (robot, fault), runs in results.items()}
            for seed in seeds
        },
        time.perf_counter() - begin,
        title="Commissioning runs",
        figure="beyond the paper",
        core_s=core_s,
        metrics=metrics,
        table=table.plain(),
    )
    return summary, table
