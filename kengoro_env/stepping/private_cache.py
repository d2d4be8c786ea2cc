"""Folders and files from which code may be loaded: only this user can write them.

A file that is cut off, as after a full disk, would kill the process that loads it. So a digest of
its content stands at its end, after the part that the loader reads.
"""

from __future__ import annotations

import os
import stat
import tempfile
from hashlib import sha256
from pathlib import Path

DIGEST = sha256().digest_size
"""Number of bytes at the end of a file that hold the digest of those before."""


def is_private(path: Path) -> bool:
    """Whether a file or folder belongs to this user, and no other user may write it.

    Links are not followed: whoever can write a link chooses what is loaded.
    """
    try:
        found = path.lstat()
    except OSError:
        return False
    foreign = found.st_uid != os.geteuid() or stat.S_ISLNK(found.st_mode)
    return not foreign and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def make_private(folder: Path) -> bool:
    """Make a folder that only this user may write; return whether it is such a folder.

    Raises:
        OSError: the folder cannot be made.
    """
    if not folder.exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
    return is_private(folder.resolve())


def private_folder() -> Path:
    """A folder of this user among the temporary files, the same for all processes if possible."""
    folder = Path(tempfile.gettempdir()) / f"kengoro-{os.geteuid()}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
    except OSError:
        return Path(tempfile.mkdtemp(prefix="kengoro-"))
    return folder if is_private(folder) else Path(tempfile.mkdtemp(prefix="kengoro-"))


def seal(path: Path) -> None:
    """Add the digest of a file to its end, and let only this user write it."""
    with path.open("ab") as file:
        file.write(sha256(path.read_bytes()).digest())
        file.flush()
        os.fsync(file.fileno())
    path.chmod(0o700)


def is_whole(path: Path) -> bool:
    """Whether a file ends in the digest of what stands before it."""
    content = path.read_bytes()
    return sha256(content[:-DIGEST]).digest() == content[-DIGEST:]
