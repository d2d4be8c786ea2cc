"""Sandbox for bags: unpacks untrusted bags in a process with limited time and memory."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from mjcf_sandbox import sandbox, worker
from mjcf_sandbox.errors import SandboxError, UntrustedFileError
from mjcf_sandbox.files import FULL, is_full
from reality_gap.errors import StudyError
from reality_gap.io.lerobot import is_dataset, unpack_dataset
from reality_gap.io.new_folder import check_new
from reality_gap.io.rosbag import unpack

SECONDS, RATE = 10.0, 10e6
"""Longest time without progress: `SECONDS` [s], and the size of the bag over `RATE` [bytes/s]."""
MEMORY, UNFOLDED = 2 << 30, 60
"""Largest memory: `MEMORY` [bytes], and `UNFOLDED` times the size of the bag."""
LEAST_SPACE = 1 << 20
"""Free space below which a disk is full [bytes]."""
_NOTES = "notes"


def unpack_in_sandbox(
    bag: Path,
    out: Path,
    topics: Sequence[str] = (),
    by_arrival: bool = False,
    progress: Callable[[float], None] = lambda share: None,
    *,
    types: Path | None = None,
    episodes: Sequence[int] = (),
    note: Callable[[str], None] = lambda sentence: None,
) -> tuple[Path, ...]:
    """Run `unpack` or `unpack_dataset` in a process with limited time and memory.

    Args:
        bag: a bag, or the folder of a LeRobot dataset.
        out: folder to create.
        topics: topics of a bag, or features of a dataset; by default all that hold numbers.
        by_arrival: use the time at which messages were recorded instead of their time stamps.
        progress: called with the fraction of the bag that has been read, 0 to 1.
        types: folder of .msg and .idl files with definitions of messages.
        episodes: numbers of a dataset's episodes; by default all.
        note: called with a sentence for each thing that was left out or is missing.

    Returns:
        The files in the order of their names.

    Raises:
        StudyError: the bag cannot be read, has no such topic, holds no numbers, crashes its reader
            or exceeds the limits, or ``out`` exists or the disk is full.
    """
    check_new(out)
    limits = _limits(bag)
    out = out.resolve()
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{out.name}-", dir=out.parent) as temporary:
        new, notes = Path(temporary) / "new", Path(temporary) / _NOTES
        task = {
            "bag": str(bag.absolute()),
            "out": str(new),
            "topics": list(topics),
            "by_arrival": by_arrival,
            "types": None if types is None else str(types.absolute()),
            "episodes": list(episodes),
            "notes": str(notes),
        }
        try:
            sandbox.run("reality_gap.io.rosbag_sandbox", [json.dumps(task)], limits, progress)
        except SandboxError as error:
            for folder in (Path(temporary), Path(tempfile.gettempdir())):
                if shutil.disk_usage(folder).free < LEAST_SPACE:
                    raise StudyError(no_space(out)) from error
            raise StudyError(f"{bag.name} {error}") from error
        except UntrustedFileError as error:
            raise StudyError(str(error).replace(str(new), str(out))) from error
        for sentence in json.loads(notes.read_text("utf-8")):
            note(sentence)
        new.rename(out)
    return tuple(sorted(out.iterdir()))


def main(task: str) -> None:
    """Entry point of the worker process: unpack a bag and pass errors on to the parent.

    Args:
        task: the arguments, as JSON.
    """
    given = json.loads(task)
    notes: list[str] = []
    bag, out = Path(given["bag"]), Path(given["out"])
    try:
        if is_dataset(bag):
            unpack_dataset(
                bag,
                out,
                given["topics"],
                given["episodes"],
                worker.report_progress,
                note=notes.append,
            )
        else:
            if given["episodes"]:
                raise StudyError(f"{bag.name} is no LeRobot dataset: --episodes is for those only")
            unpack(
                bag,
                out,
                given["topics"],
                given["by_arrival"],
                worker.report_progress,
                types=None if given["types"] is None else Path(given["types"]),
                note=notes.append,
            )
        Path(given["notes"]).write_text(json.dumps(notes), "utf-8")
    except StudyError as error:
        raise UntrustedFileError(str(error)) from error
    except OSError as error:
        if is_full(error):
            raise UntrustedFileError(no_space(out)) from error
        reason = os.strerror(error.errno) if error.errno else " ".join(str(error).split())
        where = f" ({error.filename})" if error.filename else ""
        raise UntrustedFileError(f"{bag.name} cannot be unpacked: {reason}{where}") from error


def no_space(out: Path) -> str:
    """Return the sentence for a full disk."""
    return f"there is no space left for {out}: {FULL}; free some, or choose fewer --topics"


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
