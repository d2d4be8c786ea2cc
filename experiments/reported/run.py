"""`python -m experiments reported`: moves logged runs to the record of reporting seeds."""

from __future__ import annotations

from dataclasses import dataclass

from rich.console import Console

from experiments.harness.reported import LOG, RECORD, merge_reported


@dataclass(frozen=True)
class Args:
    """Add the runs that are logged in out/reported_runs.csv to experiments/REPORTED.csv."""


def main(args: Args) -> None:
    """Merge the log into the record and print the number of runs."""
    count = merge_reported()
    Console().print(f"Runs moved from {LOG} to {RECORD}: {count}.")
