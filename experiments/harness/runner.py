"""Work that is done in parallel, by processes of this machine or by a cluster, and kept."""

from __future__ import annotations

import json
import multiprocessing
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from experiments.harness.cluster import on_cluster
from experiments.harness.common import check_jobs
from mjcf_sandbox.files import remove_parts, write_json
from mjcf_sandbox.parent_watchdog import end_with_parent

Work = Callable[..., Any]
Tasks = Mapping[str, tuple[Any, ...]]
Done = tuple[str, Any, float]
"""Name of a task, its result, and how long it took [s]."""


@contextmanager
def progress_bar(title: str, total: int) -> Iterator[Callable[[str], None]]:
    """A bar of ``total`` steps; call what it gives with a line on what was just done."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[done]}"),
    )
    with Progress(*columns) as bar:
        task = bar.add_task(title, total=total, done="")
        yield lambda done: bar.update(task, advance=1, done=done)


def run_tasks(
    work: Work,
    tasks: Tasks,
    jobs: int,
    folder: Path,
    key: str,
    cluster: str | None = None,
    again: bool = False,
) -> dict[str, Any]:
    """Results of ``work(*arguments)`` by the tasks' names, each kept in a file as soon as it ends.

    Args:
        work: a function of a module; gives what JSON can hold.
        tasks: arguments by name; names are file names.
        jobs: processes at the same time.
        folder: where results are kept; one that is there with the same ``key`` is not run again.
        key: stands for all that results depend on beside the arguments.
        cluster: address of a Ray cluster that does the work in place of processes.
        again: whether what is kept is run again.
    """
    check_jobs(jobs)
    remove_parts(folder)
    results: dict[str, Any] = {}
    with progress_bar(folder.name, len(tasks)) as tell:

        def keep(name: str, result: Any, seconds: float) -> None:
            results[name] = result
            if seconds:
                kept = {"key": key, "seconds": round(seconds, 1), "result": result}
                write_json(folder / f"{name}.json", kept)
            tell(name)

        for name in tasks:
            kept = None if again else read_kept(folder / f"{name}.json", key)
            if kept is not None:
                keep(name, kept["result"], 0.0)
        missing = {name: arguments for name, arguments in tasks.items() if name not in results}
        for done in _run(work, missing, jobs, cluster):
            keep(*done)
    return {name: results[name] for name in tasks}


def _run(work: Work, tasks: Tasks, jobs: int, cluster: str | None) -> Iterator[Done]:
    if not tasks:
        return
    if cluster is not None:
        yield from on_cluster(cluster, timed, work, tasks)
    elif jobs == 1 or len(tasks) < 2:
        for name, arguments in tasks.items():
            yield name, *timed(work, arguments)
    else:
        context = multiprocessing.get_context("spawn")
        count = min(jobs, len(tasks))
        with ProcessPoolExecutor(count, context, initializer=end_with_parent) as pool:
            futures = {pool.submit(timed, work, tasks[name]): name for name in tasks}
            for future in as_completed(futures):
                yield futures[future], *future.result()


def core_seconds(folder: Path, names: Iterable[str]) -> float:
    """Time that the named tasks of `run_tasks` took in all [s], whenever they ran."""
    kept = (json.loads((folder / f"{name}.json").read_text(encoding="utf-8")) for name in names)
    return round(sum(task["seconds"] for task in kept), 1)


def timed(work: Work, arguments: tuple[Any, ...]) -> tuple[Any, float]:
    """The result as JSON would give it back, and how long it took [s]."""
    begin = time.perf_counter()
    return json.loads(json.dumps(work(*arguments))), time.perf_counter() - begin


def read_kept(path: Path, key: str) -> dict[str, Any] | None:
    """What was kept with ``key``: the result and its seconds; None where that is not whole."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    whole = isinstance(content, dict) and {"key", "seconds", "result"} <= content.keys()
    if not whole or content["key"] != key or not isinstance(content["seconds"], int | float):
        return None
    return content
