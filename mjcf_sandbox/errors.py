"""What is wrong with a stranger's file."""


class UntrustedFileError(Exception):
    """A file that is refused; the message goes on from the file's name: "is no XML"."""


class SandboxError(UntrustedFileError):
    """The reader of a file crashed, or took too much time or memory."""


LONGEST = 200
"""Characters of a file's name that are repeated."""


def short_name(name: str) -> str:
    """A file's name that fits into a sentence."""
    return name if len(name) <= LONGEST else f"{name[:LONGEST]}..."
