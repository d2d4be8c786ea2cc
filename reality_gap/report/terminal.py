"""Terminal: the progress of a diagnosis, and the named causes as a table of text."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from reality_gap.diagnosis import Calibration, Diagnosis
from reality_gap.errors import one_line
from reality_gap.report.formatting import number, probability, rounded, shown, with_interval

LINES = 10
"""Number of lines of progress where there is no bar, about."""


@contextmanager
def shown_progress(console: Console) -> Iterator[Callable[[float, str], None]]:
    """Show progress as a bar, or where the output is no terminal as lines of standard error.

    Args:
        console: where the bar is shown.

    Yields:
        Callback for the completed share, 0 to 1, and for what is being done.
    """
    if console.is_terminal:
        with Progress(console=console, transient=True) as bar:
            task = bar.add_task("reading", total=1.0)
            yield lambda share, text: bar.update(task, completed=share, description=text)
        return
    before = (-1, "")

    def tick(share: float, text: str) -> None:
        nonlocal before
        now = int(LINES * share), text
        if now != before:
            print(f"{100.0 * share:.0f} % {text}", file=sys.stderr, flush=True)
            before = now

    yield tick


def calibration_line(diagnosis: Diagnosis, calibration: Calibration) -> str:
    """Return one sentence on the calibrated model."""
    model = "the extended model" if diagnosis.causes else "the model"
    base = "the model" if calibration.together else model
    return (
        f"calibrated.xml is {base} with {len(calibration.corrections)} of its numbers adjusted to "
        f"this log: {number(calibration.rms)} noises on held-out data, where {model} leaves "
        f"{number(diagnosis.rms_after)}. None of these adjustments is a finding."
    )


def cause_table(diagnosis: Diagnosis) -> Table:
    """Return the named causes as a table, with one row for each."""
    table = Table("cause", "location", "parameters (95 % interval)", "confidence", "equivalent")
    for cause in diagnosis.causes:
        parameters = []
        for name in cause.foremost():
            estimate = rounded(cause, name)
            factor, unit = shown(estimate.unit, estimate.value)
            value, low, high = with_interval(estimate, factor)
            parameters.append(f"{name} {value} {unit} ({low} to {high})".replace("  ", " "))
        table.add_row(
            cause.candidate.cause.title,
            one_line(str(cause.candidate.location)),
            "\n".join(parameters),
            probability(cause.confidence),
            ", ".join(cause.equivalent),
        )
    return table
