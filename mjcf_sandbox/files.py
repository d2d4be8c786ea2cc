"""Atomic writes: a reader finds the old content of a file or the new one, never a part.

A file is written beside its path under a hidden name, flushed to the disk, and then renamed.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PART = ".part"
"""Marks the name of a file while it is written: ``.NAME.PROCESS.part.SUFFIX``."""


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path to write to, which becomes ``path`` at the end and vanishes if anything goes wrong.

    It has the suffix of ``path``, from which writers infer a format. Makes the folder.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.stem}.{os.getpid()}{PART}{path.suffix}")
    try:
        yield beside
        with beside.open("rb") as file:
            os.fsync(file.fileno())
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file, whole or not at all; makes its folder."""
    with whole_file(path) as beside:
        beside.write_bytes(content)


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8, whole or not at all; makes its folder."""
    write_bytes(path, text.encode("utf-8"))


def write_json(path: Path, content: object) -> None:
    """Write JSON, whole or not at all; numbers that are not finite are refused."""
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def remove_parts(folder: Path) -> None:
    """Remove what a killed process had only begun to write to ``folder``; other files stay."""
    for path in folder.glob(f".*{PART}*"):
        if re.fullmatch(rf"\..*\.\d+{re.escape(PART)}(\.[^.]*)?", path.name):
            path.unlink(missing_ok=True)
