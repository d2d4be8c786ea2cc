"""Checkpoints: finished parts of a long diagnosis on disk, so that it can be continued."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjcf_sandbox.files import PART, whole_file, write_text
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.study.data import Study

Columns = list[NDArray[np.float32]]
"""Arrays of one part."""
PACKAGE = Path(__file__).parents[1]
"""Folder of the sources of `reality_gap`."""
KEY = "KEY"
"""Name of the file that holds the key of a checkpoint."""


class Checkpoint:
    """Arrays of finished parts, by number.

    Args:
        folder: folder of the files; it is made with the first one. None keeps nothing.
        key: key of the inputs (see `digest`); files with another key are removed.
    """

    def __init__(self, folder: Path | None, key: str) -> None:
        self._folder, self._key = folder, key
        if folder is not None and _read(folder / KEY) != key:
            forget(folder)

    def get(self, number: int, make: Callable[[], Columns]) -> Columns:
        """Return the arrays of a part; make and keep them if there are none that can be read.

        Args:
            number: number of the part.
            make: computes its arrays.
        """
        if self._folder is None:
            return make()
        path = self._folder / f"{number:05}.npz"
        try:
            with path.open("rb") as file, np.load(file, allow_pickle=False) as found:
                return [found[f"arr_{i}"] for i in range(len(found.files))]
        except Exception:  # numpy raises various exceptions for damaged files
            made = make()
        write_text(self._folder / KEY, self._key)
        with whole_file(path) as beside:
            _save(beside, made)
        return made


def forget(folder: Path) -> None:
    """Remove the files of a checkpoint, and the folder if it has no other files."""
    if not folder.is_dir():
        return
    for path in (folder / KEY, *folder.glob("[0-9]*.npz"), *folder.glob(f".*{PART}*")):
        path.unlink(missing_ok=True)
    if not any(folder.iterdir()):
        folder.rmdir()


def digest(study: Study, candidates: Sequence[Candidate]) -> str:
    """Return a key of the inputs of screening: log, model, candidates and source files."""
    found = hashlib.sha256()
    model = study.spec().compile()
    buffer = np.zeros(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    found.update(buffer.tobytes())
    found.update(repr((study.channels, study.initial, sorted(study.uses.items()))).encode())
    for episode in study.episodes:
        begin = sorted(episode.joints.items()), sorted(episode.states.items()), episode.restarts
        found.update(repr((episode.name, *begin)).encode())
        for array in (episode.time, episode.command):
            found.update(np.ascontiguousarray(array).tobytes())
        for reading in episode.readings:
            found.update(reading.time.tobytes() + b"\0" + reading.value.tobytes())
    found.update(repr([(s.cause.id, s.location, s.parameters) for s in candidates]).encode())
    sources = {path for s in candidates for path in _sources(s)} | set(PACKAGE.rglob("*.py"))
    for path in sorted(sources):
        found.update(path.name.encode() + b"\0" + path.read_bytes())
    return found.hexdigest()


def _sources(candidate: Candidate) -> list[Path]:
    """Return the source files of a candidate's cause, which may be the user's."""
    cause = candidate.cause
    found = []
    for function in (cause.locations, cause.parameters, cause.edit, cause.attach):
        while isinstance(function, partial):
            function = function.func
        if (code := getattr(function, "__code__", None)) is not None:
            found.append(Path(code.co_filename))
    return [path for path in found if path.is_file()]


def _read(path: Path) -> str | None:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None


def _save(path: Path, columns: Columns) -> None:
    with path.open("wb") as file:
        np.savez(file, *columns)
