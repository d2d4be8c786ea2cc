"""Real machines: the diagnosis beside models that a person would fit, on held-out readings.

The logs of each machine are diagnosed. The same readings are fitted by least squares with the
parameters of PACE and with those that a person would free. All are scored by their RMS error on
readings that none of them was fitted to: every fourth quarter of a second.

Data (not in this package; `--data` names the user's folder): see docs/real_machines.md.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from experiments.harness.common import (
    ROOT,
    SHOWING,
    Summary,
    check_jobs,
    files_digest,
    make_summary,
)
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import LEAST_WIDTH
from experiments.harness.report import print_table, write_report
from experiments.harness.runner import core_seconds, run_tasks
from experiments.real_machines.baselines import require_sysid
from experiments.real_machines.figures import pictures
from experiments.real_machines.machines import MACHINES, PERSON_NAME, missing
from experiments.real_machines.tables import metrics, tables
from experiments.real_machines.trial import trial
from mjcf_sandbox.files import write_json

NAME = "real-machines"
TITLE = "Diagnosis of measured machines"
QUICK_SECONDS = 4.0
FOLDERS = tuple(ROOT / "experiments" / name for name in ("real_machines", "emps", "davinci"))
"""Folders of this experiment, and of those whose loaders it uses."""


@dataclass(frozen=True)
class Args:
    """Diagnosis of measured machines, beside models that a person would fit.

    Attributes:
        data: folder with the data of the machines; one whose files are missing is left out.
        out: folder of the results.
        jobs: number of parallel processes.
        seconds: longest log of a machine; a longer one is cut [s].
        only: keys of the machines; all by default.
        quick: short logs that check the installation; their numbers mean nothing.
    """

    data: Path
    out: Path = Path("out") / NAME
    jobs: int = 1
    seconds: float = 10.0
    only: tuple[str, ...] = ()
    quick: bool = False


def main(args: Args) -> Summary:
    """Diagnose the machines; write summary.json, report.html, the studies and the diagnoses.

    Raises:
        ExperimentError: an option is wrong, or no machine can be used.
    """
    begin = time.perf_counter()
    chosen, skipped = choose(args)
    for sentence in skipped.values():
        Console().print(sentence)
    seconds = QUICK_SECONDS if args.quick else args.seconds
    tasks = {name: (name, args.data, args.out / name, seconds) for name in chosen}
    folder = args.out / "trials"
    results = run_tasks(trial, tasks, args.jobs, folder, digest(args))
    for name, result in results.items():
        if result["refused"]:
            skipped[name] = result["refused"]
            Console().print(result["refused"])
    done = {name: result for name, result in results.items() if not result["refused"]}
    if not done:
        raise ExperimentError(f"No machine can be used. {' '.join(skipped.values())}")
    spent = core_seconds(folder, tasks)
    # At least the time of all tasks, also of those that ran before.
    wall_s = max(time.perf_counter() - begin, spent / args.jobs)
    return conclude(args, done, skipped, wall_s, spent)


def choose(args: Args) -> tuple[list[str], dict[str, str]]:
    """Names of the machines whose files exist, and why the others are left out."""
    check_jobs(args.jobs)
    if unknown := [name for name in args.only if name not in MACHINES]:
        raise ExperimentError(
            f"There is no machine {unknown[0]!r}; there are: {', '.join(MACHINES)}."
        )
    if not args.data.is_dir():
        raise ExperimentError(f"There is no folder {args.data}.")
    if not args.seconds > 0.0:
        raise ExperimentError(f"The longest log is {args.seconds:g} s, but must be above 0.")
    names = args.only or tuple(MACHINES)
    skipped = {name: text for name in names if (text := missing(name, args.data)) is not None}
    chosen = [name for name in names if name not in skipped]
    if any(PERSON_NAME in MACHINES[name].baselines for name in chosen):
        require_sysid()  # before the first diagnosis, which takes minutes
    return chosen, skipped


def digest(args: Args) -> str:
    """Digest of the options, the code and the data that results depend on.

    It has the data of all machines, so that machines can be run one by one with ``--only``.
    """
    shown = (*SHOWING, "run.py")
    paths = [p for f in FOLDERS for p in sorted(f.glob("*.py")) if p.name not in shown]
    paths += sorted((ROOT / "reality_gap").rglob("*.py"))
    for pattern in sorted({pattern for one in MACHINES.values() for pattern in one.files}):
        paths += sorted(args.data.glob(pattern))
    return files_digest(paths, repr((args.seconds, args.quick)))


def conclude(
    args: Args,
    done: Mapping[str, Any],
    skipped: Mapping[str, str],
    wall_s: float,
    core_s: float,
) -> Summary:
    """Print the tables and write summary.json and report.html."""
    shown = tables(done, skipped)
    results = {
        name: {key: value for key, value in result.items() if key not in ("signals", "refused")}
        for name, result in done.items()
    }
    settings = asdict(args) | {"out": args.out.name, "data": args.data.name}
    summary = make_summary(
        NAME,
        {},
        wall_s,
        core_s=core_s,
        title=TITLE,
        quick=args.quick,
        settings=settings,
        metrics=metrics(done),
        machines=results,
        skipped=dict(skipped),
        tables=[table.plain() for table in shown],
    )
    write_json(args.out / "summary.json", summary)
    page = summary | {"seeds": ["none, for these are measurements"]}
    write_report(args.out / "report.html", TITLE, str(__doc__), page, shown, pictures(done))
    wide = Console(width=max(Console().width, LEAST_WIDTH))
    for table in shown:
        print_table(wide, table)
    wide.print(f"Report: {args.out / 'report.html'}")
    return summary
