"""One case: a folder with a hostile file, what became of it, and the process that tries it."""

from __future__ import annotations

import multiprocessing
import resource
import signal
import traceback
from collections.abc import Iterable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from tools.fuzz.watching import ROOT, Watch

FINE, REFUSED = "fine", "refused"
CRASH, HANG, OUTSIDE, RAN = "CRASH", "HANG", "READ OUTSIDE", "RAN CODE"
OUTCOMES = (FINE, REFUSED, CRASH, HANG, OUTSIDE, RAN)
BAD = (CRASH, HANG, OUTSIDE, RAN)

SECONDS = 10.0
"""How long a command may compute [s]."""
PATIENCE = 60.0
"""How long a case may take at all, on a machine that does other things, too [s]."""
MEMORY = 6 << 30
"""Largest address space of a worker [bytes]."""
LONGEST = 3000
"""Characters of a sentence."""


@dataclass(frozen=True)
class Outcome:
    """What became of a case: one of `OUTCOMES`, and where or why; equal details are one fault."""

    what: str
    detail: str = ""


class Worker:
    """A process that tries cases of one kind; a new one after each crash or hang."""

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._process: Any = None
        self._pipe: Connection | None = None

    def __call__(self, folder: Path) -> Outcome:
        """Try the case in a folder."""
        if self._process is None:
            self._start()
        assert self._pipe is not None
        try:
            self._pipe.send(str(folder))
            if self._pipe.poll(PATIENCE):
                return Outcome(*self._pipe.recv())
            self.stop()
            return Outcome(HANG, f"longer than {PATIENCE:g} s")
        except (EOFError, ConnectionError):
            self._process.join()
            code = self._process.exitcode
            self.stop()
            return Outcome(CRASH, signal.Signals(-code).name if code < 0 else f"exit code {code}")

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_work, args=(self._kind, theirs), daemon=True)
        self._process.start()
        theirs.close()
        assert self._pipe.poll(120.0), "the worker says that it is ready"
        self._pipe.recv()

    def stop(self) -> None:
        """Kill the process, if there is one."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
        self._process = None


def _work(kind: str, pipe: Connection) -> None:
    """Try the folders that come through a pipe, for ever."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    watch = Watch()
    warm_up(kind)
    pipe.send("ready")
    while True:
        outcome = attempt(kind, Path(pipe.recv()), watch)
        pipe.send((outcome.what, outcome.detail))


def computed() -> float:
    """Processor time of this process and of its children that ended [s]."""
    whose = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return sum(use.ru_utime + use.ru_stime for use in map(resource.getrusage, whose))


def warm_up(kind: str) -> None:
    """Import what the kind needs, so that no case is charged for it."""
    import tempfile

    from tools.fuzz.seeds import MAKERS
    from tools.fuzz.targets import TARGETS

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "case"
        folder.mkdir()
        MAKERS[kind.partition(" ")[0]](folder)
        for code, said in TARGETS[kind](folder):
            assert code == 0, said


def attempt(kind: str, folder: Path, watch: Watch) -> Outcome:
    """Use the files of a folder in this process."""
    from tools.fuzz.targets import TARGETS

    watch.begin(folder)
    try:
        outcome = _judge(TARGETS[kind](folder))
    except BaseException as error:
        outcome = Outcome(CRASH, _where(error))
    finally:
        watch.end()
    if watch.ran:
        return Outcome(RAN, watch.ran[0].replace(str(folder), "."))
    if watch.outside:
        return Outcome(OUTSIDE, Path(watch.outside[0]).name)
    return outcome


def _judge(commands: Iterable[tuple[int, str]]) -> Outcome:
    """What became of commands, each of which is run for what it says."""
    what, begin = FINE, computed()
    for code, text in commands:
        end = computed()
        if end - begin >= SECONDS:
            return Outcome(HANG, f"longer than {SECONDS:g} s")
        if code not in (0, 2) or (code == 2 and not text):
            return Outcome(CRASH, f"exit code {code} and {text[:80]!r}")
        if code == 2 and ("\n" in text or len(text) > LONGEST):
            return Outcome(CRASH, f"more than one sentence: {text.splitlines()[0][:60]}")
        what, begin = REFUSED if code else what, end
    return Outcome(what)


def _where(error: BaseException) -> str:
    """The kind of an exception, and our last line on the way to it."""
    lines = traceback.extract_tb(error.__traceback__)
    ours = [line for line in lines if line.filename.startswith(str(ROOT / ""))]
    ours = [line for line in ours if "/tools/fuzz/" not in line.filename] or lines
    last = ours[-1]
    return f"{type(error).__name__} at {Path(last.filename).name}:{last.name}: {str(error)[:80]}"
