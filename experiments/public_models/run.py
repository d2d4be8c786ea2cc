"""Public models: diagnoses of machines that others modelled, each as it is and with a payload.

Models of public packages are put on a stand: free bases are welded to the world, floors and other
objects removed. A smooth motion under random commands is simulated at half the model's time step,
once as it is and once with a payload on its last link. Each log is written with its model and a
STUDY.yaml, as somebody would write them, and is diagnosed by the command line.

Models (not in this package; `--models` names the user's folders): see docs/experiments.md.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from experiments.harness.common import ROOT, Summary, check_jobs, files_digest, make_summary
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import LEAST_WIDTH
from experiments.harness.report import print_table, write_report
from experiments.harness.runner import core_seconds, run_tasks
from experiments.public_models.catalogue import MODELS, find
from experiments.public_models.tables import metrics, tables
from experiments.public_models.trial import KINDS, trial
from mjcf_sandbox.files import write_json

NAME = "public-models"
TITLE = "Diagnosis of public models"
QUICK_SECONDS = 3.0


@dataclass(frozen=True)
class Args:
    """Diagnosis of machines that are simulated from public models.

    Attributes:
        models: folders with unpacked packages; models that are in none of them are left out.
        out: folder of the results.
        jobs: number of parallel processes.
        seconds: length of a log [s].
        limit: longest time of one diagnosis [s].
        only: keys of the models; all by default.
        quick: short logs that check the installation; their numbers mean nothing.
    """

    models: tuple[Path, ...]
    out: Path = Path("out") / NAME
    jobs: int = 1
    seconds: float = 10.0
    limit: float = 1200.0
    only: tuple[str, ...] = ()
    quick: bool = False


def main(args: Args) -> Summary:
    """Diagnose the models; write summary.json, report.html, the studies and the diagnoses.

    Raises:
        ExperimentError: an option is wrong, or no model can be used.
    """
    begin = time.perf_counter()
    chosen, skipped = choose(args)
    for sentence in skipped.values():
        Console().print(sentence)
    seconds = QUICK_SECONDS if args.quick else args.seconds
    tasks = {
        f"{name}_{kind}": (
            name,
            kind,
            args.models,
            args.out / f"{name}_{kind}",
            seconds,
            args.limit,
        )
        for name in chosen
        for kind in KINDS
    }
    folder = args.out / "trials"
    results = run_tasks(trial, tasks, args.jobs, folder, digest(args))
    spent = core_seconds(folder, tasks)
    # At least the time of all tasks, also of those that ran before.
    wall_s = max(time.perf_counter() - begin, spent / args.jobs)
    return conclude(args, list(results.values()), skipped, wall_s, spent)


def choose(args: Args) -> tuple[list[str], dict[str, str]]:
    """Names of the models whose files exist, and why the others are left out."""
    check_jobs(args.jobs)
    if unknown := [name for name in args.only if name not in MODELS]:
        raise ExperimentError(f"There is no model {unknown[0]!r}; there are: {', '.join(MODELS)}.")
    for folder in args.models:
        if not folder.is_dir():
            raise ExperimentError(f"There is no folder {folder}.")
    for option, value in (("log", args.seconds), ("limit", args.limit)):
        if not value > 0.0:
            raise ExperimentError(f"The {option} is {value:g} s, but must be above 0.")
    names = args.only or tuple(MODELS)
    skipped = {
        name: f"{name} is left out, for no folder has a file {MODELS[name].file}."
        for name in names
        if find(MODELS[name], args.models) is None
    }
    chosen = [name for name in names if name not in skipped]
    if not chosen:
        raise ExperimentError(f"No model can be used. {' '.join(skipped.values())}")
    return chosen, skipped


def digest(args: Args) -> str:
    """Digest of the options and the code that results depend on."""
    parts = ("catalogue", "machine", "motion", "study", "trial")
    paths = [ROOT / "experiments/public_models" / f"{part}.py" for part in parts]
    paths += sorted((ROOT / "reality_gap").rglob("*.py"))
    return files_digest(paths, repr((args.seconds, args.limit, args.quick)))


def conclude(
    args: Args,
    trials: Sequence[Mapping[str, Any]],
    skipped: Mapping[str, str],
    wall_s: float,
    core_s: float,
) -> Summary:
    """Print the tables and write summary.json and report.html."""
    if all(t["unusable"] for t in trials):
        raise ExperimentError(f"No model can be used. {trials[0]['unusable']}")
    shown = tables(trials, skipped)
    settings = asdict(args) | {"out": args.out.name, "models": [p.name for p in args.models]}
    summary = make_summary(
        NAME,
        {},
        wall_s,
        core_s=core_s,
        title=TITLE,
        quick=args.quick,
        settings=settings,
        metrics=metrics(trials),
        trials=[{k: v for k, v in t.items() if k != "measures"} for t in trials],
        skipped=dict(skipped),
        tables=[table.plain() for table in shown],
    )
    write_json(args.out / "summary.json", summary)
    page = summary | {"seeds": ["one for each model"]}
    write_report(args.out / "report.html", TITLE, str(__doc__), page, shown, [])
    wide = Console(width=max(Console().width, LEAST_WIDTH))
    for table in shown:
        print_table(wide, table)
    wide.print(f"Report: {args.out / 'report.html'}")
    return summary
