"""Processes that are killed and lines that break: who stops the robot, and how soon.

A robot in a process of its own is served in real time; an agent in another process drives it and
learns. At a random moment the agent is killed, stopped, or fails, or the line between them breaks.
The next agent goes on from what was learned. All times are control periods of the robot's own
clock.
"""

from __future__ import annotations

import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from experiments.harness import common
from experiments.harness.common import Summary, make_summary, parse_seeds
from experiments.harness.errors import ExperimentError
from experiments.harness.report import Table, metric_table, print_table, write_report
from experiments.harness.reported import log_reported
from experiments.harness.runner import progress_bar
from experiments.harness.statistics import metric
from experiments.lab_faults.trial import FAULTS, MOST_PERIODS, NO_ONE, Fault, Lab, passed
from mjcf_sandbox.files import write_json

MOST_TRIALS = 1000
SELDOM = 4
"""Faults that must not stop the robot occur once in as many rounds."""

INTRODUCTION = (
    "An agent drives a robot in another process in real time, and learns. At a random moment the "
    "agent is killed, stopped, or fails, or the line between them breaks. Who stops the robot, and "
    "within how many control periods? Is what was learned there after the restart?"
)

Trials = dict[str, list[dict[str, Any]]]


@dataclass(frozen=True)
class Args(common.Args):
    """Killed processes and broken lines: who stops the robot, and how soon.

    Attributes:
        seeds: of the moments of the faults, as A-B or A; seeds below 100 are for tuning.
        out: folder of the results.
        trials: number of trials of each fault and seed; a quarter for faults that must not stop
            the robot.
        period: control period of the robot on the wall's clock [s].
    """

    seeds: str = "0"
    out: Path = Path("out/lab-faults")
    trials: int = 20
    period: float = 0.06


def main(args: Args) -> Summary:
    """Run all trials, and write summary and report.

    Raises:
        ExperimentError: a number is out of range, or jobs or a cluster are given.
    """
    if args.jobs != Args.jobs or args.cluster is not None:
        raise ExperimentError("lab-faults needs quiet cores: leave out --jobs and --cluster.")
    if not 1 <= args.trials <= MOST_TRIALS or not 0.005 <= args.period <= 1.0:
        raise ExperimentError(
            f"Trials are {args.trials} and the period is {args.period} s; there must be 1 to "
            f"{MOST_TRIALS} trials, and the period must be 0.005 to 1 s."
        )
    begin, seeds = time.perf_counter(), parse_seeds(args.seeds)
    log_reported("lab-faults", seeds)
    count = 1 if args.quick else args.trials
    found: dict[int, Trials] = {}
    rounds = {True: -(-count // SELDOM), False: count}
    total = len(seeds) * sum(rounds[fault.stops == NO_ONE] for fault in FAULTS)
    with progress_bar("trials", total) as progress:
        for seed in seeds:
            found[seed] = run_seed(seed, count, args.period, progress)
    trials = {
        fault.name: [trial for of_seed in found.values() for trial in of_seed[fault.name]]
        for fault in FAULTS
    }
    table = table_of(trials)
    summary = make_summary(
        "lab-faults",
        found,
        time.perf_counter() - begin,
        options={"trials": count, "period": args.period},
        metrics=metrics(trials),
        table=table.plain(),
    )
    print_table(Console(), table)
    tables = [metric_table(summary["metrics"]), table]
    write_report(args.out / "report.html", "Faults of a lab", INTRODUCTION, summary, tables, ())
    write_json(args.out / "summary.json", summary)
    return summary


def run_seed(seed: int, count: int, period: float, progress: Any) -> Trials:
    """Trials of all faults, in turn, with one robot and one file of what was learned."""
    trials: Trials = {fault.name: [] for fault in FAULTS}
    with (
        tempfile.TemporaryDirectory() as folder,
        Lab(period, Path(folder) / "memory.npz", seed) as lab,
    ):
        for number in range(count):
            for fault in FAULTS:
                if fault.stops == NO_ONE and number % SELDOM:
                    continue
                trials[fault.name].append(lab.run(fault))
                progress(fault.name)
            lab.restart()
    return trials


def metrics(trials: Trials) -> dict[str, Any]:
    """Entries of ``metrics``: the worst trial counts, not the median."""
    every = [(fault, trial) for fault in FAULTS for trial in trials[fault.name]]
    periods = [trial["periods"] for _, trial in every if trial["periods"] is not None]
    stopped = np.mean([passed(fault, trial) for fault, trial in every])
    kept = np.mean([trial["kept"] for _, trial in every])
    return {
        "most_periods_until_stopped": metric([float(max(periods))], "periods", MOST_PERIODS),
        "stopped_by_the_right_side": metric([float(stopped)], "", 1.0, good="high"),
        "learned_is_kept": metric([float(kept)], "", 1.0, good="high"),
    }


def table_of(trials: Trials) -> Table:
    """Table with a row for each fault."""
    head = (
        "fault",
        "must stop it",
        "stopped by",
        "periods, median",
        "most",
        "as it must",
        "kept",
        "busy",
    )
    return Table(
        "Who stops the robot",
        head,
        [row(fault, trials[fault.name]) for fault in FAULTS],
        "The agent's side, or on the robot's side the watchdog or the end of the connection. "
        "Periods: control periods of the robot from the fault until it was stopped. Kept: trials "
        "after which the next agent knew all that was learned. Busy: attempts that do not "
        "count, because this computer kept the agent from commanding.",
    )


def row(fault: Fault, trials: Sequence[dict[str, Any]]) -> tuple[object, ...]:
    """Row of a fault."""
    by = Counter(trial["stopped"] for trial in trials)
    periods = [trial["periods"] for trial in trials if trial["periods"] is not None]
    return (
        fault.name,
        fault.stops,
        ", ".join(f"{name} {count}" for name, count in sorted(by.items())),
        f"{np.median(periods):.0f}" if periods else "-",
        max(periods) if periods else "-",
        f"{sum(passed(fault, trial) for trial in trials)} of {len(trials)}",
        f"{sum(trial['kept'] for trial in trials)} of {len(trials)}",
        sum(trial["busy"] for trial in trials),
    )
