"""Experiments of conditions on robots: their declaration, and the run that is common to all.

An experiment has conditions, such as "actual" and "nominal". Each condition runs on each robot as a
task of its own, whose result is saved as soon as it ends. From all results the experiment concludes
metrics, tables and figures, which go to ``summary.json`` and ``report.html``.

A new experiment is a folder with ``run.py`` and one line in `experiments.__main__.RUNNERS`.
``experiments/my_accuracy/run.py``::

    from dataclasses import dataclass
    from pathlib import Path
    from typing import Any

    from experiments.harness import common
    from experiments.harness.common import Summary
    from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
    from experiments.harness.report import Table
    from experiments.harness.statistics import metric
    from experiments.robots.conditions import ACTUAL, NOMINAL, make_session
    from kengoro import make_agent, shuffled_postures
    from kengoro.visits import errors, no_visits, visit

    @dataclass(frozen=True)
    class Sizes:
        postures: int = 20

    def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
        agent = make_agent(seed, cache=cache)
        start, *targets = shuffled_postures(seed)[: 1 + sizes.postures]
        session = make_session(condition, seed, agent, start)
        visits = no_visits()
        for target in targets:
            visit(session, target, visits)
        session.env.close()
        return visits  # anything that fits in JSON

    def conclude(results: Results, sizes: Sizes) -> Findings:
        per_seed = {seed: errors(result[ACTUAL]) for seed, result in results.items()}
        accuracy = metric([entry["target_true_deg"] for entry in per_seed.values()], "deg")
        rows = [(seed, entry["target_true_deg"]) for seed, entry in per_seed.items()]
        table = Table("Errors", ("robot", "deg"), rows)
        return Findings({"accuracy": accuracy}, per_seed, [table], (), {})

    EXPERIMENT = Experiment(
        "my-accuracy", "Accuracy", "Introduction of the report.", "beyond the paper",
        (ACTUAL, NOMINAL), Sizes(), Sizes(postures=1), run, conclude,
    )

    @dataclass(frozen=True)
    class Args(common.Args):
        \"\"\"One sentence for --help.\"\"\"

        seeds: str = "0-9"
        out: Path = Path("out/my-accuracy")

    def main(args: Args) -> Summary:
        return run_experiment(EXPERIMENT, args)

``experiments/__main__.py``::

    RUNNERS = {..., "my-accuracy": Runner("one line for the list")}

Files named ``figures.py``, ``tables.py`` and ``report.py`` in the folder present results without
changing them: saved results stay valid when these files change.
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
    make_summary,
    parse_seeds,
    source_digest,
)
from experiments.harness.errors import ExperimentError
from experiments.harness.report import Picture, Table, metric_table, print_table, write_report
from experiments.harness.reported import log_reported
from experiments.harness.runner import Tasks, core_seconds, run_tasks
from kengoro.session import shown_by
from kengoro.trained_maps import trained_map
from mjcf_sandbox.files import remove_parts, write_bytes, write_json

Results = dict[int, dict[str, Any]]
"""Result of each condition, by seed and condition."""


@dataclass(frozen=True)
class Findings:
    """Conclusions from the results of all robots.

    Attributes:
        metrics: by name, from `statistics.metric`.
        per_seed: numbers of each robot, few enough to read.
        tables, pictures: of the report; the first of each represents the experiment on the page
            of all results.
        more: further entries of the summary.
        closing: sentences printed at the end, in place of the table of metrics.
    """

    metrics: Mapping[str, Mapping[str, Any]]
    per_seed: Mapping[int, object]
    tables: Sequence[Table]
    pictures: Sequence[Picture]
    more: Mapping[str, object]
    closing: str = ""


@dataclass(frozen=True)
class Experiment:
    """Declaration of an experiment.

    Attributes:
        name: as typed on the command line.
        title, introduction: of the report.
        figure: of the paper that it reproduces.
        conditions: names of what runs on each robot.
        sizes, quick: dataclasses: amount of work on each robot, usually and with ``--quick``.
        run: (condition, seed, sizes, folder of maps) -> result that fits in JSON.
        conclude: (results of all robots, sizes) -> findings; may import matplotlib.
        others: further folders of the checkout whose code the results depend on.
        variant: of the experiment, which its results are named after, too; empty for the usual one.
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
    variant: str = ""

    @property
    def full_name(self) -> str:
        """Name of its results."""
        return "-".join(filter(None, (self.name, self.variant)))

    @property
    def folder(self) -> str:
        """Folder of its code in the checkout."""
        return f"experiments/{self.name.replace('-', '_')}"


LEAST_WIDTH = 110
"""Least width of the printed table [characters]."""


def run_experiment(experiment: Experiment, args: Args) -> Summary:
    """Run all conditions on all robots and write summary, report and figures.

    Tasks with a saved result of the same code and sizes do not run again.

    Args:
        experiment: its declaration.
        args: seeds, folder of the results, processes and further options.

    Returns:
        The content of ``summary.json``.

    Raises:
        ExperimentError: an option is invalid.
    """
    begin = time.perf_counter()
    sizes = experiment.quick if args.quick else experiment.sizes
    seeds = parse_seeds(args.seeds)
    check_jobs(args.jobs)
    log_reported(experiment.full_name, seeds)
    trained_map(args.cache)  # once, before several processes would train it
    tasks = {
        f"{seed:03d}-{condition}": (condition, seed, sizes, args.cache)
        for seed in seeds
        for condition in experiment.conditions
    }
    key = f"{source_digest(experiment.folder, *experiment.others)} {asdict(sizes)}"
    run = run_watched if args.view else run_unwatched
    saved = run(experiment, tasks, args, key)
    results: Results = {
        seed: {name: saved[f"{seed:03d}-{name}"] for name in experiment.conditions}
        for seed in seeds
    }
    core_s = core_seconds(args.out / "robots", tasks)
    found = experiment.conclude(results, sizes)
    summary = make_summary(
        experiment.full_name,
        found.per_seed,
        # At least the time of all tasks, also of those that ran before.
        max(time.perf_counter() - begin, core_s / args.jobs),
        title=experiment.title,
        figure=experiment.figure,
        core_s=core_s,
        sizes=asdict(sizes),
        metrics=dict(found.metrics),
        table=found.tables[0].plain(),
        **found.more,
    )
    write_results(args.out, experiment, summary, found)
    return summary


def run_unwatched(experiment: Experiment, tasks: Tasks, args: Args, key: str) -> dict[str, Any]:
    """Run the tasks in parallel; returns their results by name."""
    return run_tasks(experiment.run, tasks, args.jobs, args.out / "robots", key, args.cluster)


def run_watched(experiment: Experiment, tasks: Tasks, args: Args, key: str) -> dict[str, Any]:
    """Run the tasks one after the other in a window that shows the robots.

    Returns:
        Results by name, the same as those of `run_unwatched`.

    Raises:
        ExperimentError: the tasks would run on a cluster.
    """
    from kengoro.viewer.window import Window, open_window  # imports matplotlib

    if args.cluster is not None:
        raise ExperimentError(
            "A run on a cluster cannot be watched: leave out --view or --cluster."
        )

    def run(window: Window, condition: str, seed: int, *more: Any) -> dict[str, Any]:
        window.title = f"{experiment.title}: robot {seed}, {condition}"
        with shown_by(window.show):
            return experiment.run(condition, seed, *more)

    with open_window(experiment.title) as window:
        folder = args.out / "robots"
        return run_tasks(partial(run, window), tasks, 1, folder, key, again=True)


def write_results(out: Path, experiment: Experiment, summary: Summary, found: Findings) -> None:
    """Write figures, report and summary to ``out`` and print the metrics."""
    title, introduction = experiment.title, experiment.introduction
    tables = [metric_table(summary["metrics"]), *found.tables]
    write_files(out, title, introduction, summary, tables, found.pictures)
    if found.closing:
        print_results(out, [], [found.closing])
    else:
        print_results(out, tables[:1])


def write_files(
    out: Path,
    title: str,
    introduction: str,
    summary: Summary,
    tables: Sequence[Table],
    pictures: Sequence[Picture],
) -> None:
    """Write figures, report and summary to ``out``, of which ``summary.json`` comes last."""
    remove_parts(out)
    for number, picture in enumerate(pictures, start=1):
        write_bytes(out / f"figure_{number}.png", picture.png)
    write_report(out / "report.html", title, introduction, summary, tables, pictures)
    write_json(out / "summary.json", summary)


def print_results(out: Path, tables: Sequence[Table], sentences: Sequence[str] = ()) -> None:
    """Print tables and sentences, and where the results are."""
    console = Console()
    console.width = max(console.width, LEAST_WIDTH)
    for table in tables:
        print_table(console, table)
    for sentence in sentences:
        console.print(sentence, markup=False)
    console.print(f"Results: {out}/summary.json, report.html, figures")
