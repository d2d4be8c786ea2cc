"""Record of runs on reporting seeds, those from 100 on.

Reporting seeds are for numbers that are reported, so each use of them is on record. A run appends
one row to the log ``out/reported_runs.csv``, which git ignores. `merge_reported` moves the rows of
the log to ``experiments/REPORTED.csv``, which is part of the repository.
"""

from __future__ import annotations

import csv
import subprocess
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path

from experiments.harness.common import ROOT, command_line
from experiments.harness.errors import ExperimentError
from mjcf_sandbox.files import whole_file

FIRST_REPORTED_SEED = 100
LOG = Path("out/reported_runs.csv")
RECORD = Path("experiments/REPORTED.csv")
COLUMNS = ("experiment", "seeds", "date", "commit", "note")
"""Columns of log and record. The seeds are as `seed_ranges` writes them, the date and time are in
UTC, and the note is the command."""

Row = tuple[str, ...]


def seed_ranges(seeds: Iterable[int]) -> str:
    """Write seeds as ranges in ascending order, such as "100-109 200"; a repeated seed is kept."""
    ranges: list[list[int]] = []
    for seed in sorted(seeds):
        if ranges and seed == ranges[-1][1] + 1:
            ranges[-1][1] = seed
        else:
            ranges.append([seed, seed])
    return " ".join(f"{a}" if a == b else f"{a}-{b}" for a, b in ranges)


def log_reported(experiment: str, seeds: Sequence[int], root: Path = ROOT) -> None:
    """Append a run on reporting seeds to the log when run in a checkout.

    Args:
        experiment: name of the experiment.
        seeds: of the run; seeds below 100 are left out.
        root: folder of the checkout.
    """
    reported = {seed for seed in seeds if seed >= FIRST_REPORTED_SEED}
    if not reported or not (root / ".git").exists():
        return
    git = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=root, capture_output=True, text=True
    )
    date = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    commit = git.stdout.strip() or "none"
    path = root / LOG
    path.parent.mkdir(exist_ok=True)
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        if path.stat().st_size == 0:
            writer.writerow(COLUMNS)
        writer.writerow([experiment, seed_ranges(reported), date, commit, command_line()])


def merge_reported(root: Path = ROOT) -> int:
    """Move the runs of the log to the record; returns their number.

    Rows that the record holds already, from a merge that was stopped, are not added again.

    Args:
        root: folder of the checkout.

    Raises:
        ExperimentError: a line of the log or the record does not have the columns.
    """
    logged, recorded = read_runs(root / LOG), read_runs(root / RECORD)
    known = set(recorded)
    new = [row for row in logged if row not in known]
    if new:
        with (
            whole_file(root / RECORD) as beside,
            beside.open("w", newline="", encoding="utf-8") as file,
        ):
            csv.writer(file, lineterminator="\n").writerows([COLUMNS, *recorded, *new])
    (root / LOG).unlink(missing_ok=True)
    return len(new)


def read_runs(path: Path) -> list[Row]:
    """Rows of a log or record without the head; none if there is no such file.

    Raises:
        ExperimentError: a line does not have the columns.
    """
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        rows = [tuple(row) for row in csv.reader(file)]
    for number, row in enumerate(rows, start=1):
        if len(row) != len(COLUMNS) or (number == 1 and row != COLUMNS):
            raise ExperimentError(
                f"{path}, line {number}: {row} does not have the columns {', '.join(COLUMNS)}."
            )
    return rows[1:]
