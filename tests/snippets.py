"""Blocks of Python in Markdown pages."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

SKIP = "<!-- no test: "
"""A comment that begins so, right before a block, says why the block cannot run in a test."""


def blocks(page: Path) -> Iterator[tuple[int, str]]:
    """Number of the line before each block of Python, and its code."""
    lines = page.read_text(encoding="utf-8").splitlines()
    start = None
    for number, line in enumerate(lines):
        if line == "```python":
            start = number + 1
        elif line == "```" and start is not None:
            if not (start > 1 and lines[start - 2].startswith(SKIP)):
                yield start, "\n".join(lines[start:number])
            start = None
