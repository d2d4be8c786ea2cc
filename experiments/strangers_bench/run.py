"""Trials of the diagnosis on machines of all kinds and sizes that no threshold was set on."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from experiments.harness.common import ROOT, check_jobs, files_digest, make_summary
from experiments.harness.errors import ExperimentError
from experiments.harness.report import print_table, write_report
from experiments.harness.reported import log_reported
from experiments.harness.runner import core_seconds, run_tasks
from experiments.strangers_bench.criteria import criteria, metrics
from experiments.strangers_bench.figures import pictures
from experiments.strangers_bench.tables import tables
from experiments.strangers_bench.trial import Case, trial
from hidden_plants.strangers import KINDS
from mjcf_sandbox.files import write_json

NAME = "strangers-bench"
COUNTS = {"single": 150, "pair": 40, "outside": 60, "null": 200}
"""Trials of each kind in the full run."""
FIRST_REPORTED = 10000
"""First seed of reported runs; thresholds are set on seeds below `TUNING`."""
TUNING = 1000
QUICK_SECONDS = 6.0
INTRODUCTION = (
    "Each trial makes a machine from its seed: an arm of 1 to 7 joints with torque motors, "
    "position servos or tendons, or a log of torques, from a finger to an industrial arm, with its "
    "own sensors, clock, time step and model defaults. The real machine deviates from its model a "
    "little everywhere, and one effect is hidden in it, or two, or none, or one that no cause "
    "expresses. Its log is diagnosed by code that shares nothing with the code that hides."
)


@dataclass(frozen=True)
class Args:
    """Trials of the diagnosis on machines of all kinds and sizes.

    Attributes:
        trials: number of trials; 450 are the full run.
        seed: of the first trial; the others follow. Seeds 0 to 999 are for tuning, reported runs
            use seeds from 10000 on.
        out: folder of the results.
        jobs: number of parallel processes; the results do not depend on it.
        cluster: address of a Ray cluster that runs the trials instead; "auto" is the one that runs
            on this computer.
        seconds: length of each log [s].
        limit: longest time of one diagnosis [s]; one that takes longer counts as refused.
        kind: of all trials: single, pair, null or outside. By default 150, 40, 200 and 60 of 450.
        family: id of the (first) hidden effect; any by default.
        quick: short logs that check the installation; their numbers mean nothing.
    """

    trials: int = 450
    seed: int = 0
    out: Path = Path("out") / NAME
    jobs: int = 2
    cluster: str | None = None
    seconds: float = 10.0
    limit: float = 1200.0
    kind: str | None = None
    family: str | None = None
    quick: bool = False


def main(args: Args) -> dict[str, Any]:
    """Run the trials and write summary.json, report.html and the result of each trial."""
    begin = time.perf_counter()
    _check(args)
    chosen = cases(args)
    log_reported(NAME, [case.seed for case in chosen if case.seed >= TUNING])
    tasks = {f"trial_{case.seed}": (case,) for case in chosen}
    folder = args.out / "trials"
    found = run_tasks(trial, tasks, args.jobs, folder, digest(args), args.cluster)
    spent = core_seconds(folder, tasks)
    return conclude(args, list(found.values()), time.perf_counter() - begin, spent)


def _check(args: Args) -> None:
    check_jobs(args.jobs)
    if args.trials < 1:
        raise ExperimentError(f"Trials are {args.trials}, but at least 1 is needed.")
    if args.seed < 0:
        raise ExperimentError(f"The seed is {args.seed}, but must be at least 0.")
    if not args.limit > 0.0:
        raise ExperimentError(f"The limit is {args.limit} s, but must be above 0.")
    if args.kind is not None and args.kind not in KINDS:
        raise ExperimentError(f"There is no kind {args.kind!r}; there are: {', '.join(KINDS)}.")
    if args.seed + args.trials - 1 >= TUNING and args.seed < FIRST_REPORTED:
        raise ExperimentError(
            f"Seeds {args.seed} to {args.seed + args.trials - 1} leave those for tuning, 0 to "
            f"{TUNING - 1}; reported runs use seeds from {FIRST_REPORTED} on."
        )


def cases(args: Args) -> list[Case]:
    """Case of each trial, which depends on its seed only."""
    seconds = QUICK_SECONDS if args.quick else args.seconds
    shares = np.array(list(COUNTS.values())) / sum(COUNTS.values())
    found = []
    for seed in range(args.seed, args.seed + args.trials):
        rng = np.random.default_rng([seed, 11])
        kind = args.kind or str(rng.choice(list(COUNTS), p=shares))
        family = args.family if kind in ("single", "pair", "outside") else None
        found.append(Case(kind, seed, seconds, family, args.limit))
    return found


def digest(args: Args) -> str:
    """Digest of the options and the source code that trials depend on, apart from their seeds."""
    options = (args.seconds, args.limit, args.kind, args.family, args.quick)
    paths = [ROOT / "experiments/strangers_bench/trial.py", ROOT / "hidden_plants/secret.py"]
    for folder in (ROOT / "hidden_plants" / "strangers", ROOT / "reality_gap"):
        paths += sorted(folder.rglob("*.py"))
    return files_digest(paths, repr(options))


def conclude(
    args: Args, trials: Sequence[Mapping[str, Any]], wall_s: float, core_s: float
) -> dict[str, Any]:
    """Compute criteria and tables, print them and write the results."""
    rows = criteria(trials)
    shown = tables(rows, trials)
    kinds = [t["case"]["kind"] for t in trials]
    summary = make_summary(
        NAME,
        {t["case"]["seed"]: t for t in trials},
        wall_s,
        core_s=core_s,
        quick=args.quick,
        settings={**asdict(args), "out": args.out.name},
        kinds={kind: kinds.count(kind) for kind in KINDS},
        metrics=metrics(rows),
        numbers={row.name: row.plain() for row in rows},
        tables=[table.plain() for table in shown],
    )
    write_json(args.out / "summary.json", summary)
    title = "Diagnosis of machines of all kinds"
    write_report(args.out / "report.html", title, INTRODUCTION, summary, shown, pictures(trials))
    console = Console()
    for table in shown:
        print_table(console, table)
    console.print(f"Report: {args.out / 'report.html'}")
    return summary
