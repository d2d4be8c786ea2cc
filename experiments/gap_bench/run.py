"""The diagnosis on trial: effects are hidden at random, and every answer is counted."""

from __future__ import annotations

import hashlib
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
    musts_table,
)
from experiments.gap_bench.trial import KINDS, Case, compared_trial
from experiments.harness.common import ROOT, check_jobs, log_reported, make_summary
from experiments.harness.errors import ExperimentError
from experiments.harness.report import print_table, write_report
from experiments.harness.runner import core_seconds, run_tasks
from mjcf_sandbox.files import write_json

NAME = "gap-bench"
SHARES = {"single": 0.5, "pair": 0.1, "null": 0.2, "outside": 0.2}
QUICK_SECONDS = 8.0
INTRODUCTION = (
    "In a real machine one effect is hidden, or two, or none, or one that is in nobody's "
    "catalogue. It has small mismatches everywhere, noise and jitter, runs at a quarter of the "
    "time step, and shares no code with whoever diagnoses. Its log is diagnosed, and the answer "
    "is compared with the truth."
)


@dataclass(frozen=True)
class Args:
    """What the bench takes.

    Attributes:
        trials: how many.
        seed: of the first trial; the others follow. Seeds below 100 are for tuning.
        out: folder of the results.
        jobs: trials at the same time; the result does not depend on it.
        cluster: address of a Ray cluster that does it instead; "auto": the one that runs here.
        machine: "elbow" or "arm".
        seconds: length of each log [s].
        kind: hide this only: single, pair, null or outside. Left out: 50, 10, 20 and 20 %.
        family: draw the (first) effect from this id or family only.
        followup: do the suggested experiment where there is doubt about a single effect, and
            diagnose again.
        freed: in so many trials, the first ones, `mujoco.sysid` fits everything at once, too.
        quick: short logs, to see that it works; the numbers mean nothing then.
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
    freed: int = 0
    quick: bool = False


def main(args: Args) -> dict[str, Any]:
    """Run, count, and write summary.json, report.html and the trials."""
    begin = time.perf_counter()
    _check(args)
    tasks = {}
    for i, case in enumerate(cases(args)):
        freed = i < args.freed
        followup = args.followup and case.kind == "single"
        tasks[f"trial_{case.seed}" + freed * "_free_parameters"] = (case, followup, freed)
    log_reported([task[0].seed for task in tasks.values()])  # a run that is stopped looked, too
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
    if args.freed and not sysid_installed():
        raise ExperimentError("To free everything, install mujoco's extra: mujoco[sysid].")


def cases(args: Args) -> list[Case]:
    """What is hidden in each trial; a trial depends on its own seed only."""
    seconds = QUICK_SECONDS if args.quick else args.seconds
    found = []
    for seed in range(args.seed, args.seed + args.trials):
        rng = np.random.default_rng([seed, 11])
        drawn = str(rng.choice(list(SHARES), p=list(SHARES.values())))
        family = args.family if (args.kind or drawn) in ("single", "pair") else None
        found.append(Case(args.kind or drawn, seed, args.machine, seconds, family))
    return found


def digest(args: Args) -> str:
    """What trials rest on beside their seeds: options, and sources of hider and seeker."""
    told = (args.machine, args.seconds, args.kind, args.family, args.followup, args.quick)
    found = hashlib.sha256(repr(told).encode())
    folder = ROOT / "experiments" / "gap_bench"
    paths = [folder / f"{name}.py" for name in ("trial", "baselines", "length_errors")]
    for folder in (ROOT / "hidden_plants", ROOT / "reality_gap"):
        paths += sorted(path for path in folder.rglob("*") if path.suffix in (".py", ".json"))
    for path in paths:
        found.update(path.name.encode() + b"\0" + path.read_bytes())
    return found.hexdigest()[:24]


def conclude(
    args: Args, trials: Sequence[Mapping[str, Any]], wall_s: float, core_s: float
) -> dict[str, Any]:
    """Count, print and write."""
    rows, matrix = musts(trials), confusion(trials)
    tables = [
        musts_table(rows),
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
        "What a diagnosis finds of what was hidden",
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
