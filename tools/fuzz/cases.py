"""Cases: folders with a malformed file, their outcomes, and the worker process that tries them."""

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
RESULTS = (FINE, REFUSED, CRASH, HANG, OUTSIDE, RAN)
BAD = (CRASH, HANG, OUTSIDE, RAN)

SECONDS = 10.0
"""Largest CPU time of a command [s]."""
PATIENCE = 60.0
"""Largest wall-clock time of a case [s]; larger, because other programs may run."""
MEMORY = 6 << 30
"""Largest address space of a worker [bytes]."""
LONGEST = 3000
"""Largest length of a message [characters]."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of a case; equal outcomes are one fault.

    Attributes:
        result: one of `RESULTS`.
        detail: where or why it happened.
    """

    result: str
    detail: str = ""


class Worker:
    """Process that tries cases of one kind; it is started again after each crash or hang.

    Args:
        kind: a key of `tools.fuzz.targets.TARGETS`.
    """

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._process: Any = None
        self._pipe: Connection | None = None

    def __call__(self, folder: Path) -> Outcome:
        """Try the case in a folder; returns its outcome."""
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
        assert self._pipe.poll(120.0), "the worker does not become ready"
        self._pipe.recv()

    def stop(self) -> None:
        """Kill the process if it runs."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
        self._process = None


def _work(kind: str, pipe: Connection) -> None:
    """Try the folders whose paths come through a pipe, without end."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    watch = Watch()
    warm_up(kind)
    pipe.send("ready")
    while True:
        outcome = attempt(kind, Path(pipe.recv()), watch)
        pipe.send((outcome.result, outcome.detail))


def cpu_time() -> float:
    """CPU time of this process and of its subprocesses that ended [s]."""
    processes = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return sum(use.ru_utime + use.ru_stime for use in map(resource.getrusage, processes))


def warm_up(kind: str) -> None:
    """Use valid files once, so that the time of imports does not count for a case.

    Args:
        kind: a key of `tools.fuzz.targets.TARGETS`.
    """
    import tempfile

    from tools.fuzz.seeds import MAKERS
    from tools.fuzz.targets import TARGETS

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "case"
        folder.mkdir()
        MAKERS[kind.partition(" ")[0]](folder)
        for code, message in TARGETS[kind](folder):
            assert code == 0, message


def attempt(kind: str, folder: Path, watch: Watch) -> Outcome:
    """Use the files of a folder in this process.

    Args:
        kind: a key of `tools.fuzz.targets.TARGETS`.
        folder: of the case.
        watch: records what the process opens and runs.

    Returns:
        The outcome.
    """
    from tools.fuzz.targets import TARGETS

    watch.begin(folder)
    try:
        outcome = _classify(TARGETS[kind](folder))
    except BaseException as error:
        outcome = Outcome(CRASH, _where(error))
    finally:
        watch.end()
    if watch.ran:
        return Outcome(RAN, watch.ran[0].replace(str(folder), "."))
    if watch.outside:
        return Outcome(OUTSIDE, Path(watch.outside[0]).name)
    return outcome


def _classify(commands: Iterable[tuple[int, str]]) -> Outcome:
    """Outcome of commands, which run while the iterable is read."""
    result, begin = FINE, cpu_time()
    for code, text in commands:
        end = cpu_time()
        if end - begin >= SECONDS:
            return Outcome(HANG, f"longer than {SECONDS:g} s")
        if code not in (0, 2) or (code == 2 and not text):
            return Outcome(CRASH, f"exit code {code} and {text[:80]!r}")
        if code == 2 and ("\n" in text or len(text) > LONGEST):
            return Outcome(CRASH, f"more than one sentence: {text.splitlines()[0][:60]}")
        result, begin = REFUSED if code else result, end
    return Outcome(result)


def _where(error: BaseException) -> str:
    """Type of an exception, and the last function of this repository in its traceback."""
    lines = traceback.extract_tb(error.__traceback__)
    ours = [line for line in lines if line.filename.startswith(str(ROOT / ""))]
    ours = [line for line in ours if "/tools/fuzz/" not in line.filename] or lines
    last = ours[-1]
    return f"{type(error).__name__} at {Path(last.filename).name}:{last.name}: {str(error)[:80]}"
