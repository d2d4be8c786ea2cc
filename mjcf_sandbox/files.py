"""Atomic writes: a reader finds the old content of a file or the new one, never a part.

A file is written beside its path under a hidden name, flushed to the disk, and then renamed; the
folder is flushed last.
"""

from __future__ import annotations

import errno
import json
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mjcf_sandbox.errors import OutputError

PART = ".part"
"""Marks the name of a file while it is written: ``.NAME.PROCESS.part.SUFFIX``."""

FULL = "the disk is full, or a quota or a limit of the size of files is reached"
"""What a full disk is called in messages."""


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path to write to, which becomes ``path`` at the end and vanishes if anything goes wrong.

    It has the suffix of ``path``, from which writers infer a format. Makes the folder.

    Raises:
        OutputError: a link in the path leads nowhere, or the disk is full.
    """
    check_links(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.stem}.{os.getpid()}{PART}{path.suffix}")
    try:
        yield beside
        with beside.open("rb") as file:
            os.fsync(file.fileno())
        os.replace(beside, path)
        _flush_folder(path.parent)
    except OSError as error:
        if is_full(error):
            raise OutputError(f"there is no space left for {path}: {FULL}") from error
        raise
    finally:
        beside.unlink(missing_ok=True)


def check_links(path: Path) -> None:
    """Check that no link in a path leads nowhere, before anything is computed for it.

    Args:
        path: a file or folder that need not exist.

    Raises:
        OutputError: the path, or a folder above it, is a link to something that does not exist.
    """
    for part in (path, *path.parents):
        if part.is_symlink() and not part.exists():
            raise OutputError(
                f"{part} is a link to {os.readlink(part)}, which does not exist; make that first, "
                "or choose another path"
            )


def check_folder(path: Path) -> None:
    """Check that a path is a folder or can become one, before anything is computed for it.

    Args:
        path: a folder that need not exist.

    Raises:
        OutputError: the path, or one above it, is a file, or a link that leads nowhere.
    """
    check_links(path)
    for part in (path, *path.parents):
        if part.exists() and not part.is_dir():
            raise OutputError(f"{part} is no folder; choose another path")


def is_full(error: OSError) -> bool:
    """Whether an error says that the disk is full, or that a limit of what it may hold is."""
    return error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def _flush_folder(folder: Path) -> None:
    """Flush a folder to the disk, so that a new name in it survives a power failure."""
    if os.name != "posix":  # folders cannot be opened elsewhere
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError:  # some file systems cannot flush a folder; the file itself is on the disk
        pass
    finally:
        os.close(handle)


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
