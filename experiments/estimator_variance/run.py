"""Estimator variance: errors of estimated sizes beside the Cramer-Rao bound, structure known."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from experiments.estimator_variance.scores import coverage, machine_table, metrics
from experiments.estimator_variance.trial import trial
from experiments.harness.common import (
    ROOT,
    Summary,
    check_jobs,
    files_digest,
    make_summary,
    parse_seeds,
)
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import LEAST_WIDTH
from experiments.harness.report import metric_table, print_table, write_report
from experiments.harness.reported import log_reported
from experiments.harness.runner import core_seconds, run_tasks
from experiments.strangers_bench.run import FIRST_REPORTED, TUNING
from mjcf_sandbox.files import write_json

NAME = "estimator-variance"
TITLE = "Errors of estimated sizes beside their lower bound"
QUICK_SECONDS, QUICK_REPEATS = 3.0, 2
INTRODUCTION = (
    "Each machine of the strangers' bench hides one effect, and an estimate is told which cause it "
    "is, and where. The size is estimated in several realisations of the mismatches of the machine "
    "and of the noise of its sensors, with the tolerances of the nominal model marginalised as in "
    "a diagnosis. The errors are compared with the smallest ones of any linear estimate without "
    "bias that knows the distribution of the mismatches and the noise."
)


@dataclass(frozen=True)
class Args:
    """Errors of estimated sizes of hidden effects over their Cramer-Rao bound, structure known.

    Attributes:
        seeds: seeds of the machines, as A-B or A; 0 to 999 are for tuning, reported runs use seeds
            from 10000 on.
        repeats: number of realisations of each machine's mismatches and noise, at least 2.
        out: folder of the results.
        jobs: number of parallel processes; the results do not depend on it.
        cluster: address of a Ray cluster that runs the machines instead; "auto" is the one that
            runs on this computer.
        seconds: length of each log [s].
        quick: few short logs that check the installation; their numbers mean nothing.
    """

    seeds: str = "0-4"
    repeats: int = 12
    out: Path = Path("out") / NAME
    jobs: int = 2
    cluster: str | None = None
    seconds: float = 6.0
    quick: bool = False


def main(args: Args) -> Summary:
    """Estimate the sizes on all machines; write summary.json, report.html and each result.

    Raises:
        ExperimentError: an option is invalid, or a machine shows no such effect.
    """
    begin = time.perf_counter()
    seeds = checked_seeds(args)
    log_reported(NAME, [seed for seed in seeds if seed >= TUNING])
    seconds = QUICK_SECONDS if args.quick else args.seconds
    repeats = QUICK_REPEATS if args.quick else args.repeats
    tasks = {f"machine_{seed}": (seed, seconds, repeats) for seed in seeds}
    folder = args.out / "machines"
    found = run_tasks(trial, tasks, args.jobs, folder, digest(seconds, repeats), args.cluster)
    spent = core_seconds(folder, tasks)
    return conclude(args, list(found.values()), time.perf_counter() - begin, spent)


def checked_seeds(args: Args) -> list[int]:
    """Seeds of the machines, after a check of all options."""
    check_jobs(args.jobs)
    seeds = parse_seeds(args.seeds)
    if args.repeats < 2:
        raise ExperimentError(f"Repeats are {args.repeats}, but at least 2 are needed.")
    if not args.seconds > 0.0:
        raise ExperimentError(f"The log has {args.seconds:g} s, but must have more than 0 s.")
    if seeds[-1] >= TUNING and seeds[0] < FIRST_REPORTED:
        raise ExperimentError(
            f"Seeds {args.seeds} leave those for tuning, 0 to {TUNING - 1}; reported runs use "
            f"seeds from {FIRST_REPORTED} on."
        )
    return seeds


def digest(seconds: float, repeats: int) -> str:
    """Digest of the options and the source code that results depend on, apart from seeds."""
    own = ROOT / "experiments" / "estimator_variance"
    paths = [own / f"{part}.py" for part in ("estimate", "machine", "trial")]
    paths.append(ROOT / "experiments/strangers_bench/scores.py")
    for folder in (ROOT / "hidden_plants" / "strangers", ROOT / "reality_gap"):
        paths += sorted(folder.rglob("*.py"))
    return files_digest(paths, repr((seconds, repeats)))


def conclude(
    args: Args, trials: Sequence[Mapping[str, Any]], wall_s: float, core_s: float
) -> Summary:
    """Compute the metrics, print them and write summary.json and report.html."""
    shown = machine_table(trials)
    summary = make_summary(
        NAME,
        {one["seed"]: one for one in trials},
        # At least the time of all tasks, also of those that ran before.
        max(wall_s, core_s / args.jobs),
        title=TITLE,
        core_s=core_s,
        quick=args.quick,
        settings={**asdict(args), "out": args.out.name},
        metrics=metrics(trials),
        coverage=coverage(trials),
        table=shown.plain(),
    )
    tables = [metric_table(summary["metrics"]), shown]
    write_json(args.out / "summary.json", summary)
    write_report(args.out / "report.html", TITLE, INTRODUCTION, summary, tables, [])
    wide = Console(width=max(Console().width, LEAST_WIDTH))
    for table in tables:
        print_table(wide, table)
    wide.print(f"Report: {args.out / 'report.html'}")
    return summary
