"""What is said of a file of a robot that cannot be used."""

from __future__ import annotations

from pathlib import Path

from kengoro.errors import UsageError


def damaged(path: Path, what: str = "is damaged") -> UsageError:
    """The error that names a robot's file, and the way on.

    Args:
        path: the file.
        what: is wrong with it, as the rest of a sentence that begins with the file.
    """
    return UsageError(f"{path} {what}; remove it, and this robot runs again.")
