"""What goes wrong with a study, in one sentence for the person who wrote it."""

from __future__ import annotations

from collections.abc import Iterable

LONGEST = 2000
"""Characters of a sentence: names may be of any length."""


class RealityGapError(Exception):
    """Root of this package's errors."""

    def __str__(self) -> str:
        return one_line(super().__str__())


class StudyError(RealityGapError):
    """A study, model or log that cannot be used; says what, where, and what would be valid."""


class UnknownNameError(StudyError):
    """A name that the model or the catalogue of causes does not have."""

    def __init__(self, kind: str, name: object, known: Iterable[str]) -> None:
        super().__init__(kind, name, tuple(known))  # which is what a process sends to another

    def __str__(self) -> str:
        kind, name, known = self.args
        return one_line(f"unknown {kind} {name!r}; known: {', '.join(known) or 'none'}")


def one_line(text: str) -> str:
    """For a terminal: whatever names of columns and files hold, no line breaks and no commands."""
    line = " ".join(text.splitlines())
    if len(line) > LONGEST:
        line = f"{line[:LONGEST]} ..."
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in line)
