"""Report of an experiment: ``report.html`` with its tables and embedded figures."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import jinja2
from rich.console import Console
from rich.markup import escape
from rich.table import Table as RichTable

from experiments.harness.common import Summary
from mjcf_sandbox.files import write_text

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

GROUP_COLOURS = {
    "neck": "#3f8f3f",
    "scapula": "#3a6fb5",
    "shoulder": "#c8452f",
    "forearm": "#d39a2a",
}
"""Colours of the four joint groups in all figures."""


class Table(NamedTuple):
    """A table of a report.

    Attributes:
        title: above the table.
        head: titles of the columns.
        rows: cells, as many in each row as in the head.
        note: explanation below the table.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[object]]
    note: str = ""

    def plain(self) -> dict[str, Any]:
        """The table as strings, for JSON."""
        rows = [[str(cell) for cell in row] for row in self.rows]
        return {"title": self.title, "head": list(self.head), "rows": rows, "note": self.note}


class Picture(NamedTuple):
    """A figure of a report.

    Attributes:
        title: above the figure.
        png: content of a PNG file.
        note: explanation below the figure.
    """

    title: str
    png: bytes
    note: str = ""

    @property
    def base64(self) -> str:
        """The PNG in base64, for a data URL."""
        return base64.b64encode(self.png).decode("ascii")


def png(figure: Figure) -> bytes:
    """Content of a PNG file with a matplotlib figure."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return buffer.getvalue()


def plain_ticks(axis: Axis) -> None:
    """Label a logarithmic axis with plain numbers: 1, 2 and 5 of each decade in view."""
    low, high = sorted(axis.get_view_interval())
    steps = [digit * 10.0**exponent for exponent in range(-4, 5) for digit in (1, 2, 5)]
    ticks = [tick for tick in steps if low <= tick <= high]
    axis.set_ticks(ticks, [f"{tick:g}" for tick in ticks])
    axis.minorticks_off()


def write_report(
    path: Path,
    title: str,
    introduction: str,
    summary: Summary,
    tables: Sequence[Table],
    pictures: Sequence[Picture],
) -> None:
    """Write the report to ``path``, atomically."""
    source = (files("experiments.harness") / "report.html.j2").read_text(encoding="utf-8")
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    page = environment.from_string(source).render(
        title=title,
        introduction=introduction,
        summary=summary,
        tables=tables,
        pictures=pictures,
    )
    write_text(path, page)


def metric_table(metrics: Mapping[str, Mapping[str, Any]]) -> Table:
    """Table of the metrics of a summary."""
    head = ("", "paper", "median", "95 % interval", "worst robot", "must", "reached")
    rows = [
        (
            f"{name} [{found['unit']}]" if found["unit"] else name,
            "" if found["paper"] is None else found["paper"],
            found["median"],
            f"{found['low']} to {found['high']}",
            found["worst"],
            "" if found["must"] is None else f"{found['must']}{_judged(found)}",
            {True: "yes", False: "NO", None: ""}[found["reached"]],
        )
        for name, found in metrics.items()
    ]
    note = (
        "Median over robots with its bootstrap 95 % interval. Must: the threshold that the median "
        "is required to reach, or the worst robot, or the upper end of the interval, where it says "
        "so."
    )
    return Table("Metrics", head, rows, note)


def _judged(found: Mapping[str, Any]) -> str:
    """Which number a threshold is for, in words; empty for the median."""
    return {"worst": " (worst)", "high": " (interval)"}.get(found.get("by", "median"), "")


def print_table(console: Console, table: Table) -> None:
    """Print a table to the terminal."""
    printed = RichTable(title=escape(table.title), caption=escape(table.note))
    for number, name in enumerate(table.head):
        printed.add_column(escape(name), justify="right" if number else "left", no_wrap=not number)
    for row in table.rows:
        printed.add_row(*(escape(str(cell)) for cell in row))
    console.print(printed)
