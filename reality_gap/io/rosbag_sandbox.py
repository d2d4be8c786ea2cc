"""Sandbox for bags: unpacks untrusted bags in a process with limited time and memory."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from mjcf_sandbox import sandbox, worker
from mjcf_sandbox.errors import SandboxError, UntrustedFileError
from reality_gap.errors import StudyError
from reality_gap.io.rosbag import check_new, unpack

SECONDS, RATE = 10.0, 10e6
"""Longest time without progress: `SECONDS` [s], and the size of the bag over `RATE` [bytes/s]."""
MEMORY, UNFOLDED = 2 << 30, 60
"""Largest memory: `MEMORY` [bytes], and `UNFOLDED` times the size of the bag."""
ARRIVAL, STAMP = "arrival", "stamp"
"""Values of the argument ``clock`` of `main`."""


def unpack_in_sandbox(
    bag: Path,
    out: Path,
    topics: Sequence[str] = (),
    by_arrival: bool = False,
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[Path, ...]:
    """Run `reality_gap.io.rosbag.unpack` in a process with limited time and memory.

    Args and return value are those of `unpack`.

    Raises:
        StudyError: the bag cannot be read, has no such topic, holds no numbers, crashes its reader
            or exceeds the limits, or ``out`` exists.
    """
    check_new(out)
    limits = _limits(bag)
    out = out.resolve()
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{out.name}-", dir=out.parent) as temporary:
        new = Path(temporary) / "new"
        clock = ARRIVAL if by_arrival else STAMP
        arguments = [str(bag.absolute()), str(new), clock, *topics]
        try:
            sandbox.run("reality_gap.io.rosbag_sandbox", arguments, limits, progress)
        except SandboxError as error:
            raise StudyError(f"{bag.name} {error}") from error
        except UntrustedFileError as error:
            raise StudyError(str(error)) from error
        new.rename(out)
    return tuple(sorted(out.iterdir()))


def main(bag: str, out: str, clock: str, *topics: str) -> None:
    """Entry point of the worker process: unpack a bag and pass errors on to the parent."""
    try:
        unpack(Path(bag), Path(out), topics, clock == ARRIVAL, worker.report_progress)
    except StudyError as error:
        raise UntrustedFileError(str(error)) from error


def _limits(bag: Path) -> sandbox.Limits:
    """Return the limits for a bag; refuse a folder with links to files outside of it."""
    files = [path for path in bag.rglob("*") if path.is_file()] if bag.is_dir() else [bag]
    size = 0
    for file in files:
        if bag.is_dir() and not file.resolve().is_relative_to(bag.resolve()):
            raise StudyError(
                f"{bag.name} contains a link to {file.resolve()}; replace the link by the file"
            )
        size += file.stat().st_size if file.exists() else 0
    return sandbox.Limits(SECONDS + size / RATE, None, MEMORY + UNFOLDED * size)
