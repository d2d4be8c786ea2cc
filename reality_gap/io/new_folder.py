"""New folders of files: a folder appears with all of its files, or not at all."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mjcf_sandbox.errors import OutputError
from mjcf_sandbox.files import check_links
from reality_gap.errors import StudyError


def check_new(out: Path) -> None:
    """Raise `StudyError` if ``out`` exists, or lies behind a link that leads nowhere."""
    try:
        check_links(out)
    except OutputError as error:
        raise StudyError(str(error)) from error
    if out.exists():
        raise StudyError(f"{out} exists and is not overwritten; give a new folder")


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """A folder to write to, which becomes ``out`` at the end and vanishes on an error."""
    out = out.resolve()
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{out.name}-", dir=out.parent) as temporary:
        new = Path(temporary) / "new"
        new.mkdir()
        yield new
        new.rename(out)
