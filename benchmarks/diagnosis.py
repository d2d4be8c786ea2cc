"""How long a diagnosis takes: 20 s of the elbow and 60 s of the whole arm, on one core and on two.

What is hidden decides how much is tried: nothing, one effect, two, or one that has no name.
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
    ("nothing", Case("null", 1)),
    ("one effect", Case("single", 32)),
    ("two effects", Case("pair", 4)),
    ("a hard stop", Case("outside", 34)),
)
ARM = ("whole arm, one effect", Case("single", 0, "arm", 60.0))
JOBS = (1, 2)


def seconds(case: Case, jobs: int, progress: Progress) -> float:
    """Time from the study on disk to its diagnosis, the next experiment included [s]."""
    task = progress.add_task("", total=1.0)
    with tempfile.TemporaryDirectory() as name:
        write_case(Path(name), case)
        begin = time.perf_counter()

        def show(share: float, what: str) -> None:
            progress.update(task, completed=share, description=what)

        diagnose(load_study(Path(name) / "STUDY.yaml"), jobs, show, options=Options())
        spent = time.perf_counter() - begin
    progress.remove_task(task)
    return spent


def main() -> None:
    """Measure and print."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # for the workers
    table = Table(title="seconds of a diagnosis")
    for head in ("hidden", "log [s]", *(f"--jobs {jobs}" for jobs in JOBS), "wanted on 2 cores"):
        table.add_column(head, justify="left" if head == "hidden" else "right")
    with Progress(transient=True) as progress:
        for what, case in ELBOW:
            spent = [f"{seconds(case, jobs, progress):.0f}" for jobs in JOBS]
            table.add_row(what, f"{case.seconds:.0f}", *spent, "60")
        what, case = ARM
        blank = [""] * (len(JOBS) - 1)
        spent = [f"{seconds(case, JOBS[-1], progress):.0f}"]
        table.add_row(what, f"{case.seconds:.0f}", *blank, *spent, "900")
    Console().print(table)


if __name__ == "__main__":
    main()
