"""report.html: one page with tables and figures inside it."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import jinja2

from experiments.common import Summary, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Table(NamedTuple):
    """A table: head and rows of cells, with what to read from it."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[object]]
    note: str = ""


class Picture(NamedTuple):
    """A figure as PNG, with what to read from it."""

    title: str
    png: bytes
    note: str = ""

    @property
    def base64(self) -> str:
        """The PNG as text for a data URL."""
        return base64.b64encode(self.png).decode("ascii")


def png(figure: Figure) -> bytes:
    """A matplotlib figure as PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return buffer.getvalue()


def write_report(
    path: Path,
    title: str,
    introduction: str,
    summary: Summary,
    tables: Sequence[Table],
    pictures: Sequence[Picture],
) -> None:
    """Write the page, whole or not at all."""
    source = (files("experiments") / "report.html.j2").read_text(encoding="utf-8")
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    page = environment.from_string(source).render(
        title=title,
        introduction=introduction,
        summary=summary,
        tables=tables,
        pictures=pictures,
    )
    write_text(path, page)
