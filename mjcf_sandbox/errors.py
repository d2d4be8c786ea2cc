"""Errors of untrusted files, and of files that cannot be written."""


class UntrustedFileError(Exception):
    """A file that is refused; the message continues the file's name, such as "is not XML"."""


class SandboxError(UntrustedFileError):
    """The reader of a file crashed, or exceeded its limits of time or memory."""


class OutputError(OSError):
    """A file or folder that cannot be written, as a sentence."""


LONGEST = 200
"""Largest number of characters of a file's name in a message."""


def short_name(name: str) -> str:
    """A file's name, shortened for a message."""
    return name if len(name) <= LONGEST else f"{name[:LONGEST]}..."
