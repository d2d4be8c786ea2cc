"""Prose in Markdown files is wrapped at 120 columns; tables and code are not."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
WIDTH = 120
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]


def too_long(text: str) -> Iterator[int]:
    """Numbers of the lines of prose that are longer than `WIDTH` and have a space to break at.

    Fenced and indented code, tables and comments are no prose.
    """
    fenced = False
    for number, line in enumerate(text.splitlines(), start=1):
        if line.lstrip().startswith("```"):
            fenced = not fenced
        elif fenced or line.startswith(("    ", "|", "<!--")):
            continue
        elif len(line) > WIDTH and " " in line.strip():
            yield number


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_prose_is_wrapped(page: Path) -> None:
    assert list(too_long(page.read_text(encoding="utf-8"))) == []


def test_only_long_prose_is_found() -> None:
    long = "word " * 30
    page = f"{long}\n```text\n{long}\n```\n| {long} |\n    {long}\n{'x' * 130}\n* {long}\n"
    assert list(too_long(page)) == [1, 8]
