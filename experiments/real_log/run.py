"""Map and joint estimator on the log of a measured cable-driven robot, offline.

The log of a da Vinci Research Kit has commanded joint angles, from which motor angles follow, and
joint angles that a camera measured. In the order of time our map is learned from 1, 3, 5, 10 and 27
samples of the first half, on the transmission of the data sheet, by the estimator, prior and fit of
the agent with default options. In the second half the estimator finds the joint angles from the
lengths alone. Beside it: the data sheet, one constant for each joint, a linear regression and a
Gaussian process of the same samples, and the floor, which is what samples with the same motor
angles differ by. What is left is compared with the direction of motion.

Data (not in this package; `--data` names the user's folder): M. Hwang et al., IEEE RA-L
5(4):5937-5944, 2020.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
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
from experiments.real_log.machine import NAMES, UNITS, cable_lengths, sheet_angles
from experiments.real_log.tables import direction_table, error_table, metrics, progress_table
from experiments.real_log.trial import COUNTS, floor, load, trial
from mjcf_sandbox.files import write_json

NAME = "real-log"
TITLE = "Map and joint estimator on a measured log"
QUICK_COUNTS = (1, 3)


@dataclass(frozen=True)
class Args:
    """Map and joint estimator on the log of a measured cable-driven robot, offline.

    Attributes:
        data: folder with q_des*.npy, q_act*.npy and t_stamp*.npy of a dVRK.
        out: folder of the results.
        jobs: number of parallel processes.
        starts: number of samples in the first half of the log at which learning begins.
        cache: folder of trained maps; by default the user's cache folder.
        quick: a short log that checks the installation; its numbers mean nothing.
    """

    data: Path
    out: Path = Path("out") / NAME
    jobs: int = 1
    starts: int = 3
    cache: Path | None = None
    quick: bool = False


def main(args: Args) -> Summary:
    """Learn from each start; write summary.json and report.html.

    Raises:
        ExperimentError: an option is wrong, or the log cannot be used.
    """
    begin = time.perf_counter()
    check_jobs(args.jobs)
    if args.starts < 1:
        raise ExperimentError(f"Starts are {args.starts}, but at least 1 is needed.")
    least = floor(args.data, args.quick)
    counts = QUICK_COUNTS if args.quick else COUNTS
    starts = 1 if args.quick else args.starts
    tasks = {
        f"start-{number}-of-{starts}": (args.data, number / starts, counts, args.cache, args.quick)
        for number in range(starts)
    }
    folder = args.out / "starts"
    trials = list(run_tasks(trial, tasks, args.jobs, folder, _digest(args)).values())
    spent = core_seconds(folder, tasks)
    # At least the time of all starts, also of those that ran before.
    wall_s = max(time.perf_counter() - begin, spent / args.jobs)
    return conclude(args, trials, least, counts, wall_s, spent)


def conclude(
    args: Args,
    trials: list[dict[str, Any]],
    least: dict[str, Any],
    counts: tuple[int, ...],
    wall_s: float,
    core_s: float,
) -> Summary:
    """Print the tables and write summary.json and report.html."""
    from experiments.real_log.figures import picture

    found = metrics(trials, least, counts)
    shown = [
        error_table(trials, least, counts[-1]),
        progress_table(trials, least, counts),
        direction_table(trials, least),
    ]
    summary = make_summary(
        NAME,
        {},
        wall_s,
        title=TITLE,
        quick=args.quick,
        core_s=core_s,
        metrics=found,
        joints=dict(zip(NAMES, UNITS, strict=True)),
        log=least,
        trials=[_without_signals(one) for one in trials],
        tables=[table.plain() for table in shown],
    )
    write_json(args.out / "summary.json", summary)
    asked = sheet_angles(cable_lengths(load(args.data, args.quick)))
    figure = picture(trials, least, counts, asked, np.array(trials[0]["missed"]))
    page = summary | {"seeds": ["none, for these are measurements"]}
    write_report(args.out / "report.html", TITLE, str(__doc__), page, shown, [figure])
    wide = Console(width=max(Console().width, LEAST_WIDTH))
    for table in shown:
        print_table(wide, table)
    wide.print(f"Report: {args.out / 'report.html'}")
    return summary


def _without_signals(one: dict[str, Any]) -> dict[str, Any]:
    """A trial without what it misses at each sample."""
    return {key: value for key, value in one.items() if key != "missed"}


def _digest(args: Args) -> str:
    """Digest of the options, the code and the data that results depend on."""
    hidden = (*SHOWING, "run.py")
    folder = ROOT / "experiments" / "real_log"
    paths = [path for path in sorted(folder.glob("*.py")) if path.name not in hidden]
    paths += sorted((ROOT / "jmm_agent").rglob("*.py"))
    paths += sorted(args.data.glob("*.npy"))
    return files_digest(paths, repr(args.quick))
