"""Time of a diagnosis: logs of 20 s of the elbow and 60 s of the whole arm, on one and two cores.

The number of hypotheses that are tried depends on the hidden effects, so the cases have none, one,
two, and one outside of the catalogue.
"""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

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

TARGETS = {"elbow": 60, "arm": 900}
"""Largest acceptable times with two processes, by machine [s]."""


def seconds(case: Case, jobs: int, progress: Progress) -> float:
    """Time to load and diagnose a study, including the proposal of the next experiment [s]."""
    task = progress.add_task("", total=1.0)
    with tempfile.TemporaryDirectory() as name:
        write_case(Path(name), case)
        begin = time.perf_counter()

        def show(share: float, stage: str) -> None:
            progress.update(task, completed=share, description=stage)

        diagnose(load_study(Path(name) / "STUDY.yaml"), jobs, show, options=Options())
        duration = time.perf_counter() - begin
    progress.remove_task(task)
    return duration


def main() -> None:
    """Print the table."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # for the workers
    table = Table(title="Time of a diagnosis [s]")
    jobs_columns = [f"--jobs {jobs}" for jobs in JOBS]
    for column in ("hidden effect", "log [s]", *jobs_columns, "target on 2 cores"):
        table.add_column(column, justify="left" if column == "hidden effect" else "right")
    with Progress(transient=True) as progress:
        for label, case in ELBOW:
            times = [f"{seconds(case, jobs, progress):.0f}" for jobs in JOBS]
            table.add_row(label, f"{case.seconds:.0f}", *times, f"{TARGETS['elbow']}")
        label, case = ARM
        blank = [""] * (len(JOBS) - 1)
        last = f"{seconds(case, JOBS[-1], progress):.0f}"
        table.add_row(label, f"{case.seconds:.0f}", *blank, last, f"{TARGETS['arm']}")
    Console().print(table)


if __name__ == "__main__":
    main()
