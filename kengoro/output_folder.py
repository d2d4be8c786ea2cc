"""Folders that a command writes to."""

from __future__ import annotations

import os
from pathlib import Path

from kengoro.errors import UsageError


def make_folder(folder: Path) -> None:
    """Make a folder, and those above it.

    Raises:
        UsageError: it cannot be made or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"The folder {folder} cannot be made: {error.strerror}.") from error
    if not os.access(folder, os.W_OK):
        raise UsageError(f"The folder {folder} cannot be written to.")
