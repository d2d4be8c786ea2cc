"""Trials of the diagnosis: effects are hidden at random, and all answers are counted."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from experiments.gap_bench.baselines import sysid_installed
from experiments.gap_bench.criteria import musts
from experiments.gap_bench.figures import pictures
from experiments.gap_bench.tables import (
    baselines_table,
    causes_table,
    confusion,
    confusion_table,
)
from experiments.gap_bench.trial import KINDS, Case, compared_trial
from experiments.harness.common import ROOT, check_jobs, files_digest, make_summary
from experiments.harness.criteria import criteria_table
from experiments.harness.errors import ExperimentError
from experiments.harness.report import print_table, write_report
from experiments.harness.reported import log_reported
from experiments.harness.runner import core_seconds, run_tasks
from mjcf_sandbox.files import write_json

NAME = "gap-bench"
SHARES = {"single": 0.5, "pair": 0.1, "null": 0.2, "outside": 0.2}
QUICK_SECONDS = 8.0
INTRODUCTION = (
    "In a simulated machine one effect is hidden, or two, or none, or one outside the catalogue. "
    "The machine has small mismatches everywhere, noise and jitter, runs at a quarter of the time "
    "step, and shares no code with the diagnosis. Its log is diagnosed, and the answer is compared "
    "with the truth."
)


@dataclass(frozen=True)
class Args:
    """Trials of the diagnosis on machines with hidden effects.

    Attributes:
        trials: number of trials.
        seed: of the first trial; the others follow. Seeds below 100 are for tuning.
        out: folder of the results.
        jobs: number of parallel processes; the results do not depend on it.
        cluster: address of a Ray cluster that runs the trials instead; "auto" is the one that runs
            on this computer.
        machine: "elbow" or "arm".
        seconds: length of each log [s].
        kind: of all trials: single, pair, null or outside. By default 50, 10, 20 and 20 % of these.
        family: sample the (first) effect from this id or family only.
        followup: run the suggested experiment where a single effect is uncertain, and diagnose
            again.
        free_parameters: number of trials, from the first, in which `mujoco.sysid` also fits all
            parameters at once.
        quick: short logs that check the installation; their numbers mean nothing.
    """

    trials: int = 300
    seed: int = 0
    out: Path = Path("out") / NAME
    jobs: int = 2
    cluster: str | None = None
    machine: str = "elbow"
    seconds: float = 20.0
    kind: str | None = None
    family: str | None = None
    followup: bool = False
    free_parameters: int = 0
    quick: bool = False


def main(args: Args) -> dict[str, Any]:
    """Run the trials and write summary.json, report.html and the result of each trial."""
    begin = time.perf_counter()
    _check(args)
    tasks = {}
    for i, case in enumerate(cases(args)):
        free = i < args.free_parameters
        followup = args.followup and case.kind == "single"
        tasks[f"trial_{case.seed}" + free * "_free_parameters"] = (case, followup, free)
    log_reported("gap-bench", [task[0].seed for task in tasks.values()])  # before the first trial
    key = digest(args)
    kept = args.out / "trials"
    found = run_tasks(compared_trial, tasks, args.jobs, kept, key, args.cluster)
    spent = core_seconds(args.out / "trials", tasks)
    return conclude(args, list(found.values()), time.perf_counter() - begin, spent)


def _check(args: Args) -> None:
    check_jobs(args.jobs)
    if args.trials < 1:
        raise ExperimentError(f"Trials are {args.trials}, but at least 1 is needed.")
    if args.kind is not None and args.kind not in KINDS:
        raise ExperimentError(f"There is no kind {args.kind!r}; there are: {', '.join(KINDS)}.")
    if args.free_parameters and not sysid_installed():
        raise ExperimentError(
            "--free-parameters needs the extra mujoco[sysid]: pip install 'mujoco[sysid]'."
        )


def cases(args: Args) -> list[Case]:
    """Case of each trial, which depends on the seed of the trial only."""
    seconds = QUICK_SECONDS if args.quick else args.seconds
    found = []
    for seed in range(args.seed, args.seed + args.trials):
        rng = np.random.default_rng([seed, 11])
        kind = args.kind or str(rng.choice(list(SHARES), p=list(SHARES.values())))
        family = args.family if kind in ("single", "pair") else None
        found.append(Case(kind, seed, args.machine, seconds, family))
    return found


def digest(args: Args) -> str:
    """Digest of the options and the source code that trials depend on, apart from their seeds."""
    options = (args.machine, args.seconds, args.kind, args.family, args.followup, args.quick)
    folder = ROOT / "experiments" / "gap_bench"
    paths = [folder / f"{name}.py" for name in ("trial", "baselines", "length_errors")]
    for folder in (ROOT / "hidden_plants", ROOT / "reality_gap"):
        paths += sorted(path for path in folder.rglob("*") if path.suffix in (".py", ".json"))
    return files_digest(paths, repr(options))


def conclude(
    args: Args, trials: Sequence[Mapping[str, Any]], wall_s: float, core_s: float
) -> dict[str, Any]:
    """Compute criteria and tables, print them and write the results."""
    rows, matrix = musts(trials), confusion(trials)
    tables = [
        criteria_table(rows),
        baselines_table(trials),
        causes_table(trials),
        confusion_table(matrix),
    ]
    kinds = [t["case"]["kind"] for t in trials]
    summary = make_summary(
        NAME,
        {t["case"]["seed"]: t for t in trials},
        wall_s,
        core_s=core_s,
        quick=args.quick,
        settings={**asdict(args), "out": args.out.name},
        kinds={kind: kinds.count(kind) for kind in KINDS},
        musts={row.name: row.plain() for row in rows},
        confusion=matrix,
        tables=[table.plain() for table in tables],
    )
    write_json(args.out / "summary.json", summary)
    write_report(
        args.out / "report.html",
        "Diagnosis of hidden effects",
        INTRODUCTION,
        summary,
        tables,
        pictures(trials, matrix),
    )
    console = Console()
    for table in tables:
        print_table(console, table)
    console.print(f"Report: {args.out / 'report.html'}")
    return summary
