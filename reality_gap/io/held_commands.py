"""Held commands: fills the rows of a log in which no command was given with the one before."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from reality_gap.io.recordings import Run
from reality_gap.types import Floats

Note = Callable[[str], None]
"""Called with a sentence on what was changed."""


def hold_commands(run: Run, commands: Sequence[str], note: Note) -> Run:
    """Return a run in which each row has all commands, as each is held until the next.

    Rows before the first command are left out.

    Args:
        run: the run.
        commands: names of the columns of commands; those that the run lacks are ignored.
        note: called with a sentence on what was changed.
    """
    own = [name for name in commands if name in run.columns]
    gaps = [name for name in own if np.isnan(run.columns[name]).any()]
    held = {name: _held(run.columns[name]) for name in gaps}
    first = max((int(np.argmax(~np.isnan(cells))) for cells in held.values()), default=0)
    if not gaps or any(np.isnan(cells).all() for cells in held.values()):
        return run
    rows = max(int(np.count_nonzero(np.isnan(run.columns[name][first:]))) for name in gaps)
    before = f"; {first} rows before the first commands were left out" if first else ""
    note(f"{run.name}: in {rows} rows without a command, the one before is held{before}")
    columns = {name: cells[first:] for name, cells in (run.columns | held).items()}
    return replace(run, time=run.time[first:], columns=columns)


def _held(cells: Floats) -> Floats:
    """Return cells (n,), each empty one with the value before it; NaN before the first value."""
    known = ~np.isnan(cells)
    last = np.maximum.accumulate(np.where(known, np.arange(len(cells)), -1))
    return np.where(last < 0, np.nan, cells[last.clip(0)])
