"""Files that are written whole or not at all."""

from __future__ import annotations

import json
import os
from pathlib import Path

PART = ".tmp"
"""How the name of a file ends while it is written."""


def write_json(path: Path, content: object) -> None:
    """Write JSON, whole or not at all; numbers that are not finite are refused."""
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text file, whole or not at all; makes its folder."""
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file, whole or not at all; makes its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f"{path.name}.{os.getpid()}{PART}")
    try:
        beside.write_bytes(content)
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)


def remove_parts(folder: Path) -> None:
    """Remove what a run that was killed had only begun to write; what others call so stays."""
    for path in folder.glob(f"*{PART}"):
        if path.with_suffix("").suffix[1:].isdigit():
            path.unlink(missing_ok=True)
