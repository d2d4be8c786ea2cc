"""Time and memory of a diagnosis: the elbow, an arm with meshes, a finger, and the whole arm.

The number of hypotheses that are tried depends on the hidden effects, so that the elbow has none,
one, two, and one outside of the catalogue. The arm with meshes has six joints with servos, and a
payload. The finger is a stand-in for MyoSuite's: four joints and five muscles. Memory is that of
the largest process so far, which includes the cases above.
"""

from __future__ import annotations

import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from benchmarks import _made_machines
from experiments.gap_bench.trial import Case, write_case
from reality_gap import Options, diagnose, load_study

ELBOW = (
    ("none", Case("null", 1)),
    ("one effect", Case("single", 32)),
    ("two effects", Case("pair", 4)),
    ("a hard stop", Case("outside", 34)),
)
ARM = ("whole arm, one effect", Case("single", 0, "arm", 60.0))
JOBS = (1, 2)
"""Numbers of worker processes."""

TARGETS = {"elbow": 60, "meshes": 40, "finger": 60, "arm": 240}
"""Largest acceptable times with two processes, by machine [s]."""

Write = Callable[[Path], object]
"""Writes a study to a folder."""


def seconds(write: Write, jobs: int, progress: Progress) -> float:
    """Time to load and diagnose a study, including the proposal of the next experiment [s]."""
    task = progress.add_task("", total=1.0)
    with tempfile.TemporaryDirectory() as name:
        write(Path(name))
        begin = time.perf_counter()

        def show(share: float, stage: str) -> None:
            progress.update(task, completed=share, description=stage)

        diagnose(load_study(Path(name) / "STUDY.yaml"), jobs, show, options=Options())
        duration = time.perf_counter() - begin
    progress.remove_task(task)
    return duration


def memory() -> float:
    """Largest memory of this process and of its workers so far [MB]."""
    unit = 1024.0**2 if sys.platform == "darwin" else 1024.0
    who = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return max(resource.getrusage(one).ru_maxrss for one in who) / unit


def cases() -> list[tuple[str, float, str, Write, tuple[int, ...]]]:
    """Title, length of the log [s], key of the target, writer and numbers of processes."""
    found: list[tuple[str, float, str, Write, tuple[int, ...]]] = []
    for label, case in ELBOW:
        write = partial(write_case, case=case)
        found.append((f"elbow, {label}", case.seconds, "elbow", write, JOBS))
    found += [
        ("six joints with meshes, payload", 20.0, "meshes", _made_machines.arm, JOBS),
        ("finger with five muscles, payload", 10.0, "finger", _made_machines.finger, JOBS),
    ]
    label, case = ARM
    return [*found, (label, case.seconds, "arm", partial(write_case, case=case), JOBS[-1:])]


def main() -> None:
    """Print the table."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # for the workers
    table = Table(title="Time and memory of a diagnosis")
    jobs_columns = [f"--jobs {jobs} [s]" for jobs in JOBS]
    for column in (
        "case",
        "log [s]",
        *jobs_columns,
        "target on 2 cores [s]",
        "most memory so far [MB]",
    ):
        table.add_column(column, justify="left" if column == "case" else "right")
    with Progress(transient=True) as progress:
        for label, length, key, write, counts in cases():
            times = dict[int, str]()
            for jobs in counts:
                times[jobs] = f"{seconds(write, jobs, progress):.0f}"
                progress.console.print(f"{label}, --jobs {jobs}: {times[jobs]} s")
            shown = [times.get(jobs, "") for jobs in JOBS]
            table.add_row(label, f"{length:.0f}", *shown, f"{TARGETS[key]}", f"{memory():.0f}")
    Console().print(table)


if __name__ == "__main__":
    main()
