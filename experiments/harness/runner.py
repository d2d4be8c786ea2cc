"""Runner of tasks: in parallel processes or on a cluster, with one result file for each task."""

from __future__ import annotations

import json
import multiprocessing
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console
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
"""Name of a task, its result and its duration [s]."""


@contextmanager
def progress_bar(title: str, total: int) -> Iterator[Callable[[str], None]]:
    """Progress bar of ``total`` steps; lines, at most a hundred, where there is no terminal.

    Yields:
        A function to call after each step, with a short text about the step.
    """
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[done]}"),
    )
    console = Console()
    if not console.is_terminal:
        yield _lines(title, total)
        return
    with Progress(*columns, console=console) as bar:
        task = bar.add_task(title, total=total, done="")
        yield lambda done: bar.update(task, advance=1, done=done)


def _lines(title: str, total: int) -> Callable[[str], None]:
    """Return the function that prints a line for each hundredth of the steps."""
    begin, count = time.monotonic(), 0

    def line(done: str) -> None:
        nonlocal count
        count += 1
        if 100 * count // total > 100 * (count - 1) // total:
            minutes = (time.monotonic() - begin) / 60.0
            print(f"{title}: {count} of {total} after {minutes:.1f} min, {done}", flush=True)

    return line


def run_tasks(
    work: Work,
    tasks: Tasks,
    jobs: int,
    folder: Path,
    key: str,
    cluster: str | None = None,
    again: bool = False,
) -> dict[str, Any]:
    """Run ``work(*arguments)`` for each task and save each result to a file as soon as it ends.

    Args:
        work: a function of a module; its result must fit in JSON.
        tasks: arguments by name of the task; names are valid file names.
        jobs: number of parallel processes.
        folder: of the result files; a task with a file of the same ``key`` does not run again.
        key: identifies everything that results depend on, except the arguments.
        cluster: address of a Ray cluster that runs the tasks instead of processes.
        again: run tasks with a saved result, too.

    Returns:
        Results by name, in the order of the tasks.
    """
    check_jobs(jobs)
    remove_parts(folder)
    results: dict[str, Any] = {}
    with progress_bar(folder.name, len(tasks)) as progress:
        for name in tasks:
            saved = None if again else read_saved(folder / f"{name}.json", key)
            if saved is not None:
                results[name] = saved["result"]
                progress(name)
        missing = {name: arguments for name, arguments in tasks.items() if name not in results}
        for name, result, seconds in _run(work, missing, jobs, cluster):
            results[name] = result
            content = {"key": key, "seconds": round(seconds, 1), "result": result}
            write_json(folder / f"{name}.json", content)
            progress(name)
    return {name: results[name] for name in tasks}


def _run(work: Work, tasks: Tasks, jobs: int, cluster: str | None) -> Iterator[Done]:
    if not tasks:
        return
    if cluster is not None:
        yield from on_cluster(cluster, timed, work, tasks)
    elif jobs == 1 or len(tasks) < 2:
        yield from _successful((name, partial(timed, work, tasks[name])) for name in tasks)
    else:
        context = multiprocessing.get_context("spawn")
        count = min(jobs, len(tasks))
        with ProcessPoolExecutor(count, context, initializer=end_with_parent) as pool:
            futures = {pool.submit(timed, work, tasks[name]): name for name in tasks}
            yield from _successful((futures[f], f.result) for f in as_completed(futures))


def _successful(calls: Iterable[tuple[str, Callable[[], tuple[Any, float]]]]) -> Iterator[Done]:
    """Yield what calls return; name each that fails, and raise the first error after the last call.

    The results of the others are not lost, and a run that continues does not repeat them.
    """
    failed: Exception | None = None
    for name, call in calls:
        try:
            found = call()
        except BrokenExecutor:
            raise
        except Exception as error:
            Console(stderr=True).print(f"{name}: {type(error).__name__}: {error}", markup=False)
            failed = failed or error
        else:
            yield name, *found
    if failed is not None:
        raise failed


def core_seconds(folder: Path, names: Iterable[str]) -> float:
    """Total duration of the named tasks of `run_tasks` [s], including those of earlier runs."""
    saved = (json.loads((folder / f"{name}.json").read_text(encoding="utf-8")) for name in names)
    return round(sum(task["seconds"] for task in saved), 1)


def timed(work: Work, arguments: tuple[Any, ...]) -> tuple[Any, float]:
    """Result of ``work(*arguments)`` after a round trip through JSON, and its duration [s]."""
    begin = time.perf_counter()
    return json.loads(json.dumps(work(*arguments))), time.perf_counter() - begin


def read_saved(path: Path, key: str) -> dict[str, Any] | None:
    """Content of a result file; None if it is missing, damaged or of another ``key``."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    whole = isinstance(content, dict) and {"key", "seconds", "result"} <= content.keys()
    if not whole or content["key"] != key or not isinstance(content["seconds"], int | float):
        return None
    return content
