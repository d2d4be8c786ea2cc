"""Bags from strangers: unpacked behind a fence, since their readers trust what they read."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from mjcf_sandbox import sandbox, worker
from mjcf_sandbox.errors import SandboxError, UntrustedFileError
from reality_gap.errors import StudyError
from reality_gap.io.rosbag import check_new, unpack

SECONDS, RATE = 10.0, 10e6
"""How long nothing may be read: so long [s], and as a whole at this rate [bytes/s] to open it."""
MEMORY, UNFOLDED = 2 << 30, 60
"""Most memory: so much [bytes], and so many times the size of the bag."""
ARRIVAL, STAMP = "arrival", "stamp"


def unpack_in_sandbox(
    bag: Path,
    out: Path,
    topics: Sequence[str] = (),
    by_arrival: bool = False,
    tell: Callable[[float], None] = lambda share: None,
) -> tuple[Path, ...]:
    """As `reality_gap.io.rosbag.unpack`, in a process of its own with limits of time and memory.

    Raises:
        StudyError: the bag cannot be read, has no such topic, holds no numbers, crashes its reader
            or takes too much of it, or ``out`` exists.
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
            sandbox.run("reality_gap.io.rosbag_sandbox", arguments, limits, tell)
        except SandboxError as error:
            raise StudyError(f"{bag.name} {error}") from error
        except UntrustedFileError as error:
            raise StudyError(str(error)) from error
        new.rename(out)
    return tuple(sorted(out.iterdir()))


def main(bag: str, out: str, clock: str, *topics: str) -> None:
    """Behind the fence: unpack a bag; what is wrong with it is the study's writer's to know."""
    try:
        unpack(Path(bag), Path(out), topics, clock == ARRIVAL, worker.tell)
    except StudyError as error:
        raise UntrustedFileError(str(error)) from error


def _limits(bag: Path) -> sandbox.Limits:
    """What reading a bag may take; refuses one whose files lie elsewhere."""
    files = [path for path in bag.rglob("*") if path.is_file()] if bag.is_dir() else [bag]
    size = 0
    for file in files:
        if bag.is_dir() and not file.resolve().is_relative_to(bag.resolve()):
            raise StudyError(f"{bag.name} holds a link to {file.resolve()}; copy the file there")
        size += file.stat().st_size if file.exists() else 0
    return sandbox.Limits(SECONDS + size / RATE, None, MEMORY + UNFOLDED * size)
