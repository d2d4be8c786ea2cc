"""Errors of reality_gap: each message is one line that says what is wrong and what is valid."""

from __future__ import annotations

from collections.abc import Iterable

LONGEST = 2000
"""Largest number of characters in a message; names of files and columns may be longer."""


class RealityGapError(ValueError):
    """Base class of all errors that reality_gap raises on purpose."""

    def __str__(self) -> str:
        return one_line(super().__str__())


class StudyError(RealityGapError):
    """A study, model or log that cannot be used, or a wrong argument."""


class TimeLimitError(RealityGapError):
    """A diagnosis that has found no verdict within its limit of time.

    Args:
        limit: the limit [s].
        doing: what it was doing.
    """

    def __init__(self, limit: float, doing: str) -> None:
        super().__init__(limit, doing)  # the arguments that pickle passes on

    def __str__(self) -> str:
        limit, doing = self.args
        return (
            f"no verdict within {limit:g} s, while {doing}; allow more time (--time-limit), "
            "consider fewer causes (--causes), or use a shorter log"
        )


class UnknownNameError(StudyError, KeyError):
    """A name that is not in the model or not in the catalogue of causes.

    Args:
        kind: what the name should denote, such as "cause".
        name: the unknown name.
        known: the valid names.
    """

    def __init__(self, kind: str, name: object, known: Iterable[str]) -> None:
        super().__init__(kind, name, tuple(known))  # the arguments that pickle passes on

    def __str__(self) -> str:
        kind, name, known = self.args
        return one_line(f"unknown {kind} {name!r}; known: {', '.join(known) or 'none'}")


def one_line(text: str) -> str:
    """Make text from untrusted files safe to print: one line without control characters."""
    line = " ".join(text.splitlines())
    if len(line) > LONGEST:
        line = f"{line[:LONGEST]} ..."
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in line)
