"""What is the same in every experiment: conditions on robots, results kept, summary and report.

A study has conditions, such as "actual" and "drawing". Each condition runs on each robot by itself,
its result is kept as soon as it ends, and what is concluded from all results is written at the end.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console

from experiments.harness.common import (
    Args,
    Summary,
    check_jobs,
    log_reported,
    make_summary,
    parse_seeds,
    source_digest,
)
from experiments.harness.errors import ExperimentError
from experiments.harness.report import Picture, Table, metric_table, print_table, write_report
from experiments.harness.runner import Tasks, core_seconds, run_tasks
from kengoro.session import observed_by
from kengoro.trained_maps import trained_map
from mjcf_sandbox.files import remove_parts, write_bytes, write_json

Results = dict[int, dict[str, Any]]
"""What each condition brought, by seed and condition."""


@dataclass(frozen=True)
class Findings:
    """What is concluded from all results.

    Attributes:
        metrics: by name, from `statistics.metric`.
        per_seed: numbers of each robot, small enough to read.
        tables, pictures: for the report; the first of each stands for the whole experiment.
        more: further entries of the summary.
    """

    metrics: Mapping[str, Mapping[str, Any]]
    per_seed: Mapping[int, object]
    tables: Sequence[Table]
    pictures: Sequence[Picture]
    more: Mapping[str, object]


@dataclass(frozen=True)
class Study:
    """One experiment.

    Attributes:
        name: as typed.
        title, introduction: of the report.
        figure: of the paper that it stands for.
        others: folders of other experiments or packages on whose code results depend.
        conditions: what runs on each robot.
        sizes, quick: dataclasses: how much is done on each robot, usually and in a hurry.
        run: (condition, seed, sizes, folder of maps) -> result that JSON can hold.
        conclude: from the results of all robots to findings; may load matplotlib.
    """

    name: str
    title: str
    introduction: str
    figure: str
    conditions: Sequence[str]
    sizes: Any
    quick: Any
    run: Callable[[str, int, Any, Path | None], dict[str, Any]]
    conclude: Callable[[Results, Any], Findings]
    others: Sequence[str] = ()

    @property
    def folder(self) -> str:
        """Its own folder in the checkout."""
        return f"experiments/{self.name.replace('-', '_')}"


LEAST_WIDTH = 110
"""Characters in a line of the printed table."""


def run_study(study: Study, args: Args) -> Summary:
    """Run all conditions on all robots, or what of it is missing; write summary and report.

    Args:
        study: what to do.
        args: seeds, folder of results, processes, folder of maps, and whether in a hurry.
    """
    begin = time.perf_counter()
    sizes = study.quick if args.quick else study.sizes
    seeds = parse_seeds(args.seeds)
    check_jobs(args.jobs)
    log_reported(seeds)
    trained_map(args.cache)  # once, before many processes would train it
    tasks = {
        f"{seed:03d}-{condition}": (condition, seed, sizes, args.cache)
        for seed in seeds
        for condition in study.conditions
    }
    key = f"{source_digest(study.folder, *study.others)} {asdict(sizes)}"
    run = run_watched if args.view else run_unwatched
    kept = run(study, tasks, args, key)
    results: Results = {
        seed: {name: kept[f"{seed:03d}-{name}"] for name in study.conditions} for seed in seeds
    }
    core_s = core_seconds(args.out / "robots", tasks)
    found = study.conclude(results, sizes)
    summary = make_summary(
        study.name,
        found.per_seed,
        max(time.perf_counter() - begin, core_s / args.jobs),  # what was there already took time
        title=study.title,
        figure=study.figure,
        core_s=core_s,
        sizes=asdict(sizes),
        metrics=dict(found.metrics),
        table=found.tables[0].plain(),
        **found.more,
    )
    conclude_run(args.out, study, summary, found)
    return summary


def run_unwatched(study: Study, tasks: Tasks, args: Args, key: str) -> dict[str, Any]:
    """Results of the tasks by name, in parallel."""
    return run_tasks(study.run, tasks, args.jobs, args.out / "robots", key, args.cluster)


def run_watched(study: Study, tasks: Tasks, args: Args, key: str) -> dict[str, Any]:
    """The same results, one task after the other while a window shows the robots.

    Raises:
        ExperimentError: the work is to be done elsewhere.
    """
    from kengoro.viewer.window import Window, open_window  # matplotlib takes a second to load

    if args.cluster is not None:
        raise ExperimentError(
            "What a cluster runs cannot be watched: leave out --view or --cluster."
        )

    def run(window: Window, condition: str, seed: int, *more: Any) -> dict[str, Any]:
        window.title = f"{study.title}: robot {seed}, {condition}"
        with observed_by(window.look):
            return study.run(condition, seed, *more)

    with open_window(study.title) as window:
        folder = args.out / "robots"
        return run_tasks(partial(run, window), tasks, 1, folder, key, again=True)


def conclude_run(out: Path, study: Study, summary: Summary, found: Findings) -> None:
    """Write figures, report and summary to ``out``, and show the metrics."""
    remove_parts(out)
    for number, picture in enumerate(found.pictures, start=1):
        write_bytes(out / f"figure_{number}.png", picture.png)
    tables = [metric_table(summary["metrics"]), *found.tables]
    report = out / "report.html"
    write_report(report, study.title, study.introduction, summary, tables, found.pictures)
    write_json(out / "summary.json", summary)
    console = Console()
    console.width = max(console.width, LEAST_WIDTH)
    print_table(console, tables[0])
    console.print(f"Results: {out}/summary.json, report.html, figures")
